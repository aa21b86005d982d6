#include <algorithm>

#include "bench/peer_process.h"
#include "bench/side_by_side.h"
#include "bench/side_by_side_cases.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/adapters/voxel_block_grid.h"
#include "eval/run/open_source.h"

namespace tsdfpp {

Expected<void> RunPeers(const SideBySideOptions& options) {
  TSDFPP_ASSIGN(const std::vector<SideBySideCase> cases, CasesNamed(options.cases));
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const SideBySideCase& of = cases.front();
  const double truncation_m = of.truncation_voxels * of.voxel_m;
  SetOpen3dThreads(options.threads.front());
  Open3dVolume scalable(of.voxel_m, truncation_m);
  VoxelBlockGridPeer small_blocks(of.voxel_m, truncation_m, 8);
  VoxelBlockGridPeer large_blocks(of.voxel_m, truncation_m, 16);  // Open3D's own default
  const int end = std::min(source->info().frame_count, options.first + options.frames);
  for (int next = options.first; next < end && AwaitPeerTurn(); next += kFramesInARow) {
    TSDFPP_ASSIGN(const auto frames, ReadFramesInARow(*source, of, next, end));
    const auto integrate = [&](const char* name, auto& volume) {
      PeerTimes times{name, 0, {}};
      for (int k = 0; k < static_cast<int>(frames.size()); ++k) {
        const double seconds = volume.Integrate(frames[static_cast<std::size_t>(k)]);
        if (next + k >= options.first + options.warm_up) times.ms.push_back(1e3 * seconds);
      }
      times.bytes = volume.OccupiedBytes();
      SayPeerTimes(times);
    };
    integrate("Open3D ScalableTSDFVolume", scalable);
    integrate("Open3D VoxelBlockGrid, blocks of 8", small_blocks);
    integrate("Open3D VoxelBlockGrid, blocks of 16", large_blocks);
    EndPeerTurn();
  }
  return {};
}

}  // namespace tsdfpp
