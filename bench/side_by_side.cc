#include "bench/side_by_side.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>

#include "bench/median.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/open_source.h"
#include "mapper/pipeline.h"

namespace tsdfpp {
Expected<void> RunSideBySide(const SideBySideOptions& options) {
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const SequenceInfo& info = source->info();
  MapConfig map;
  TSDFPP_RETURN_IF_ERROR(map.SetProfile(options.profile));
  for (const int threads : options.threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    SetOpen3dThreads(threads);
    std::vector<std::unique_ptr<Pipeline>> pipelines;
    std::vector<std::vector<double>> update_s(AllMethods().size());
    std::vector<std::vector<double>> total_s(AllMethods().size());
    for (const Method method : AllMethods()) {
      pipelines.push_back(std::make_unique<Pipeline>(
          PipelineConfig{method, map, PoseSource::kGiven, {}}, info.objects));
    }
    Open3dVolume peer(map.voxel_m, map.trunc_front_voxels * map.voxel_m);
    std::vector<double> peer_s;
    const int last = std::min(info.frame_count, options.frames);
    for (int i = 0; i < last; ++i) {
      TSDFPP_ASSIGN(const Frame frame, source->Read(info.first_index + i));
      const double integrate_s = peer.Integrate(frame);
      const bool counted = i >= options.warm_up;
      if (counted) peer_s.push_back(integrate_s);
      for (std::size_t m = 0; m < pipelines.size(); ++m) {
        const StepTimes times = pipelines[m]->Process(frame);
        if (!counted) continue;
        update_s[m].push_back(times.update_poses_s);
        total_s[m].push_back(times.update_poses_s + times.fuse_s);
      }
    }
    std::printf("%s, frames %d to %d, profile %s, %d threads; median ms a frame\n",
                info.name.c_str(), info.first_index + options.warm_up, info.first_index + last - 1,
                options.profile.c_str(), threads);
    std::printf("%-28s %10s %10s %12s\n", "", "moves", "all", "over Open3D");
    std::printf("%-28s %10s %10.1f %12.2f\n", "Open3D ScalableTSDFVolume", "-",
                1e3 * Median(peer_s), 1.0);
    for (std::size_t m = 0; m < pipelines.size(); ++m) {
      std::vector<double> ratios;
      for (std::size_t i = 0; i < peer_s.size(); ++i) ratios.push_back(total_s[m][i] / peer_s[i]);
      std::printf("%-28s %10.1f %10.1f %12.2f\n", std::string(MethodName(AllMethods()[m])).c_str(),
                  1e3 * Median(update_s[m]), 1e3 * Median(total_s[m]), Median(ratios));
    }
  }
  return {};
}

}  // namespace tsdfpp
