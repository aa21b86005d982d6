#include "bench/mesh.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <optional>

#include "bench/median.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/adapters/voxel_block_grid.h"
#include "eval/open_source.h"
#include "mapper/pipeline.h"

namespace tsdfpp {
namespace {

constexpr int kRepeats = 5;        // of a mesh from scratch at the end
constexpr int kSmallChanges = 15;  // at the end

template <typename Function>
double MillisecondsOf(const Function& function) {
  const auto start = std::chrono::steady_clock::now();
  function();
  return 1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double ResidentMegabytes() {
  std::ifstream statm("/proc/self/statm");
  double size = 0;
  double resident = 0;
  statm >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// Kept meshes, an update each.
struct KeptTimes {
  std::vector<double> share;       // of changed blocks
  std::vector<double> index_ms;    // the index, where it is brought up to date when it is needed
  std::vector<double> update_ms;   // of the parts
  std::vector<double> changes_ms;  // and the changed ones for somebody who follows the scene
  std::vector<double> all_ms;      // with joining all parts to one mesh
  // Where a copy was meshed from scratch beside it: kept over (scratch times share).
  std::vector<double> whole_ms;
  std::vector<double> update_ratio;
  std::vector<double> changes_ratio;
  std::vector<double> all_ratio;

  void Measure(const MapRepresentation& map, bool also_whole);
  // `peer_ms` is a quarter of what Open3D takes for a whole mesh, where that is of the same map.
  void Print(const std::string& name, std::optional<double> peer_ms) const;
};

void KeptTimes::Measure(const MapRepresentation& map, bool also_whole) {
  index_ms.push_back(MillisecondsOf([&] { map.ListAt(Eigen::Vector3i::Zero()); }));
  MeshWork work;
  update_ms.push_back(MillisecondsOf([&] { work = map.UpdateMeshes(); }));
  changes_ms.push_back(update_ms.back() + MillisecondsOf([&] { map.TakeSceneChanges(); }));
  all_ms.push_back(changes_ms.back() + MillisecondsOf([&] { map.SceneMesh(); }));
  share.push_back(static_cast<double>(work.changed) / static_cast<double>(work.blocks));
  if (!also_whole) return;
  const auto copy = map.Clone();
  whole_ms.push_back(MillisecondsOf([&] { copy->SceneMesh(); }));
  const double fair_ms = whole_ms.back() * share.back();
  update_ratio.push_back(update_ms.back() / fair_ms);
  changes_ratio.push_back(changes_ms.back() / fair_ms);
  all_ratio.push_back(all_ms.back() / fair_ms);
}

void KeptTimes::Print(const std::string& name, std::optional<double> peer_ms) const {
  std::printf("%-16s %8.3f %8.1f %8.2f %8.2f %8.2f %8.2f %8.2f %8.2f %8.2f", name.c_str(),
              Median(share), Median(whole_ms), Median(index_ms), Median(update_ms),
              Median(update_ratio), Median(changes_ms), Median(changes_ratio), Median(all_ms),
              Median(all_ratio));
  if (peer_ms) std::printf(" %13.2f", Median(changes_ms) / (*peer_ms * Median(share)));
  std::printf("\n");
}

// One method's map and what was measured of it.
struct Run {
  std::string name;
  std::unique_ptr<Pipeline> pipeline;
  double growth_mb = 0;
  KeptTimes frames;  // of the run
  KeptTimes small;   // of frames that show one object alone
};

// The labels of the object that fills the most pixels, the background apart; nothing else.
cv::Mat LargestObjectAlone(const Frame& frame) {
  std::map<InstanceId, int> pixels;
  for (int v = 0; v < frame.mask.rows; ++v) {
    for (int u = 0; u < frame.mask.cols; ++u) ++pixels[frame.mask.at<InstanceId>(v, u)];
  }
  InstanceId largest = kNoInstance;
  for (const auto& [id, count] : pixels) {
    if (id == kBackground || id == kNoInstance) continue;
    if (largest == kNoInstance || count > pixels[largest]) largest = id;
  }
  cv::Mat labels(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
  labels.setTo(cv::Scalar(largest), frame.mask == static_cast<double>(largest));
  return labels;
}

// The child prints "milliseconds triangles bytes growth_mb" of VoxelBlockGrid.
struct ChildResult {
  double mesh_ms = 0;
  double triangles = 0;
  double bytes = 0;
  double growth_mb = 0;
  bool finished = false;
};

ChildResult AskChild(const MeshBenchOptions& options) {
  constexpr int kLimit_s = 600;
  std::array<char, 4096> self{};
  const ssize_t length = readlink("/proc/self/exe", self.data(), self.size() - 1);
  ChildResult result;
  if (length <= 0) return result;
  const std::string command = fmt::format(
      "timeout {} '{}' voxel-block-grid --scene '{}' --open3d-band {} --voxel {} --frames {} "
      "--threads {} 2>/dev/null",
      kLimit_s, self.data(), options.scene, options.open3d_band, options.voxel_m, options.frames,
      options.threads);
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return result;
  const int read = std::fscanf(pipe, "%lf %lf %lf %lf", &result.mesh_ms, &result.triangles,
                               &result.bytes, &result.growth_mb);
  result.finished = pclose(pipe) == 0 && read == 4;
  return result;
}

void PrintMeshing(const std::vector<Run>& runs, const std::vector<double>& final_ms,
                  const std::vector<std::size_t>& triangles, const Open3dVolume::Mesh& scalable,
                  const ChildResult& grid) {
  std::printf("\nvisible scene from scratch, the last frame\n%-28s %10s %10s %12s\n", "",
              "triangles", "ms", "over Open3D");
  const double peer_ms = 1e3 * scalable.seconds;
  std::printf("%-28s %10zu %10.1f %12.3f\n", "Open3D ScalableTSDFVolume", scalable.triangles,
              peer_ms, 1.0);
  if (grid.finished) {
    std::printf("%-28s %10.0f %10.1f %12.3f\n", "Open3D VoxelBlockGrid", grid.triangles,
                grid.mesh_ms, grid.mesh_ms / peer_ms);
  } else {
    std::printf("%-28s %10s\n", "Open3D VoxelBlockGrid", "aborted");
  }
  for (std::size_t m = 0; m < runs.size(); ++m) {
    std::printf("%-28s %10zu %10.1f %12.3f\n", runs[m].name.c_str(), triangles[m], final_ms[m],
                final_ms[m] / peer_ms);
  }
  const auto print_kept = [&](const char* title, KeptTimes Run::*times,
                              std::optional<double> quarter_ms) {
    std::printf(
        "\nkept meshes, %s; ms, medians; ratios are over (from scratch x share of changed blocks)\n"
        "%-16s %8s %8s %8s %8s %8s %8s %8s %8s %8s",
        title, "", "share", "scratch", "index", "update", "ratio", "+ taking", "ratio", "+ joining",
        "ratio");
    if (quarter_ms) std::printf(" %13s", "over Open3D/4");
    std::printf("\n");
    for (const Run& run : runs) (run.*times).Print(run.name, quarter_ms);
  };
  print_kept("frame by frame", &Run::frames, {});
  const double faster_ms = grid.finished ? std::min(peer_ms, grid.mesh_ms) : peer_ms;
  print_kept("the last frame's largest object observed alone", &Run::small, faster_ms / 4);
  std::printf(
      "(taking: of the parts that changed. over Open3D/4: that, over a quarter of the faster "
      "Open3D's time x share)\n");
}

void PrintMemory(const std::vector<Run>& runs, const Open3dVolume& peer, double peer_growth_mb,
                 const ChildResult& grid) {
  std::printf("\nmemory, MB\n%-28s %14s %10s %10s\n", "", "occupied blocks", "growth", "meshes");
  std::printf("%-28s %14.1f %10.1f %10s\n", "Open3D ScalableTSDFVolume",
              static_cast<double>(peer.OccupiedBytes()) / 1e6, peer_growth_mb, "-");
  if (grid.finished) {
    std::printf("%-28s %14.1f %10.1f %10s\n", "Open3D VoxelBlockGrid", grid.bytes / 1e6,
                grid.growth_mb, "-");
  }
  for (const Run& run : runs) {
    const MapMemory memory = run.pipeline->map().Memory();
    std::printf("%-28s %14.1f %10.1f %10.1f\n", run.name.c_str(),
                static_cast<double>(memory.bytes) / 1e6, run.growth_mb,
                static_cast<double>(memory.mesh_bytes) / 1e6);
  }
  std::printf(
      "(occupied blocks: with lists and tables; growth: of the process, meshes left out)\n");
}

}  // namespace

Expected<void> RunMeshBench(const MeshBenchOptions& options) {
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const SequenceInfo& info = source->info();
  MapConfig config;
  config.voxel_m = options.voxel_m;
  TSDFPP_RETURN_IF_ERROR(config.SetProfile(options.profile));
  TSDFPP_RETURN_IF_ERROR(config.Validate());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(options.threads));
  SetOpen3dThreads(options.threads);

  std::vector<Run> runs;
  for (const Method method : AllMethods()) {
    runs.emplace_back();
    runs.back().name = MethodName(method);
    runs.back().pipeline = std::make_unique<Pipeline>(
        PipelineConfig{method, config, PoseSource::kGiven, {}}, info.objects);
  }
  Open3dVolume peer(config.voxel_m, options.open3d_band * config.voxel_m);
  double peer_growth_mb = 0;
  const int count = std::min(info.frame_count, options.frames);
  for (int i = 0; i < count; ++i) {
    TSDFPP_ASSIGN(const Frame frame, source->Read(info.first_index + i));
    const auto growth_of = [](const auto& function) {
      const double before = ResidentMegabytes();
      function();
      return ResidentMegabytes() - before;
    };
    peer_growth_mb += growth_of([&] { peer.Integrate(frame); });
    for (Run& run : runs) {
      run.growth_mb += growth_of([&] { run.pipeline->Process(frame); });
      run.frames.Measure(run.pipeline->map(), (i + 1) % options.every == 0 || i + 1 == count);
      if (i + 1 < count) continue;
      const cv::Mat labels = LargestObjectAlone(frame);
      const auto copy = run.pipeline->map().Clone();
      copy->TakeSceneChanges();
      for (int repeat = 0; repeat < kSmallChanges; ++repeat) {
        copy->Fuse(frame, labels);
        run.small.Measure(*copy, true);
      }
    }
  }
  std::printf(
      "%s, frames %d to %d, profile %s (bands of %g voxels in front, %g behind; Open3D's of %g), "
      "voxels of %g m, %d threads\n",
      info.name.c_str(), info.first_index, info.first_index + count - 1, options.profile.c_str(),
      config.trunc_front_voxels, config.trunc_back_voxels, options.open3d_band, options.voxel_m,
      options.threads);

  std::vector<double> peer_ms;
  std::vector<std::vector<double>> whole_ms(runs.size());
  std::vector<std::size_t> triangles(runs.size());
  Open3dVolume::Mesh scalable;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    scalable = peer.ExtractMesh();
    peer_ms.push_back(scalable.seconds);
    for (std::size_t m = 0; m < runs.size(); ++m) {
      const auto copy = runs[m].pipeline->map().Clone();
      whole_ms[m].push_back(
          MillisecondsOf([&] { triangles[m] = copy->SceneMesh().triangles.size(); }));
    }
  }
  scalable.seconds = Median(peer_ms);
  std::vector<double> final_ms;
  for (const auto& times : whole_ms) final_ms.push_back(Median(times));
  const ChildResult grid = AskChild(options);
  PrintMeshing(runs, final_ms, triangles, scalable, grid);
  PrintMemory(runs, peer, peer_growth_mb, grid);
  return {};
}

Expected<void> RunVoxelBlockGrid(const MeshBenchOptions& options) {
  constexpr int kBlockSide_voxels = 16;  // Open3D's own default
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const SequenceInfo& info = source->info();
  SetOpen3dThreads(options.threads);
  VoxelBlockGridPeer peer(options.voxel_m, options.open3d_band * options.voxel_m,
                          kBlockSide_voxels);
  double growth_mb = 0;
  const int count = std::min(info.frame_count, options.frames);
  for (int i = 0; i < count; ++i) {
    TSDFPP_ASSIGN(const Frame frame, source->Read(info.first_index + i));
    const double before = ResidentMegabytes();
    peer.Integrate(frame);
    growth_mb += ResidentMegabytes() - before;
  }
  std::vector<double> times_ms;
  VoxelBlockGridPeer::Mesh mesh;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    mesh = peer.ExtractMesh();
    times_ms.push_back(1e3 * mesh.seconds);
  }
  std::printf("%.3f %zu %zu %.1f\n", Median(times_ms), mesh.triangles, peer.OccupiedBytes(),
              growth_mb);
  return {};
}

}  // namespace tsdfpp
