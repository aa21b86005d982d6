#include "mapper/methods/literal_fusion.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "mapper/volume/allocation.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

struct Task {
  Index3 index;
  PairIndex::Block* lists = nullptr;
  PlannedBlock planned;
  std::vector<InstanceId> targets;  // objects that take an observation here, increasing
  bool changed = false;  // values; where another object is active now, it took an observation
};

// The blocks of the index that the frame looks at, those that it allocates among them.
std::vector<Task> PlanTasks(const FrameView& view, const MapConfig& config,
                            const CameraFromLattice& T_CW, PairIndex& index) {
  const auto lattice_of = [&](InstanceId) -> LatticeOfLabel {
    return {Pose::Identity(), &index.blocks().directory()};
  };
  for (const auto& [id, indices] : BlocksAlongRays(view, config, lattice_of)) {
    for (const Index3& block : indices) index.blocks().FindOrAdd(block);
  }
  std::vector<Task> tasks;
  tasks.reserve(index.blocks().size());
  const auto sorted = index.blocks().Sorted();
  const auto candidate_at = [&](std::size_t k) -> BlockCandidate {
    return {sorted[k]->index, &T_CW, kNoInstance, true};
  };
  for (const PlannedBlock& planned :
       PlanBlocks(view, sorted.size(), config.voxel(), config.back(), candidate_at)) {
    const auto* entry = sorted[planned.number];
    tasks.push_back({entry->index, entry->block.get(), planned, {}});
  }
  return tasks;
}

void Vote(const FrameView& frame, const MapConfig& config, const CameraFromLattice& T_CW,
          const PairIndex& index, Task& task) {
  BlockObservation observation;
  const BlockPlace place = PlaceOf(T_CW, task.index, config.voxel(), task.planned);
  if (!ObserveVoxels(frame.kernel, place, config.back(), observation)) return;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const std::int32_t pixel = observation.pixel[i];
    if (pixel < 0 || observation.distance[i] > config.front()) continue;
    index.Vote(*task.lists, i, frame.kernel.label[pixel]);
    const InstanceId active = task.lists->active[i].id;
    auto& targets = task.targets;
    const auto at = std::lower_bound(targets.begin(), targets.end(), active);
    if (at == targets.end() || *at != active) targets.insert(at, active);
  }
}

void FuseActive(const FrameView& frame, const MapConfig& config, const CameraFromLattice& T_CW,
                ObjectVolumes& volumes, Task& task) {
  BlockObservation observation;
  const BlockPlace place = PlaceOf(T_CW, task.index, config.voxel(), task.planned);
  if (!ObserveVoxels(frame.kernel, place, config.back(), observation)) return;
  const auto weight_cap = static_cast<float>(config.weight_cap);
  for (auto& [id, volume] : volumes) {
    TsdfBlock* block = volume.grid.Find(task.index);
    if (block == nullptr) continue;
    bool changed = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      const std::int32_t pixel = observation.pixel[i];
      if (pixel < 0 || task.lists->active[i].id != id) continue;
      const float s = observation.distance[i];
      const float facing = frame.kernel.facing == nullptr ? 1 : frame.kernel.facing[pixel];
      if (s <= config.front()) {
        const bool coloured =
            std::abs(s) <=
            (block->ColourCount(i) == 0 ? config.first_colour_band() : config.colour_band());
        FuseVoxel(*block, i, s * facing, coloured ? frame.kernel.colour + 3 * pixel : nullptr,
                  weight_cap);
        changed = true;
      } else if (frame.kernel.label[pixel] == id) {
        FuseVoxel(*block, i, std::min(s * facing, config.front()), nullptr, weight_cap);
        changed = true;
      }
    }
    if (!changed) continue;
    block->UpdateMasks(config.back());
    task.changed = true;
  }
}

}  // namespace

std::vector<Index3> FuseIntoActive(const FrameView& frame, const MapConfig& config,
                                   PairIndex& index, ObjectVolumes& volumes) {
  const CameraFromLattice T_CW(frame.T_WC, Pose::Identity(), true);
  std::vector<Task> tasks = PlanTasks(frame, config, T_CW, index);
  const auto for_each_task = [&](const auto& function) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, tasks.size(), kBlocksPerTask),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) function(tasks[i]);
        },
        tbb::simple_partitioner());
  };
  for_each_task([&](Task& task) { Vote(frame, config, T_CW, index, task); });
  for (const Task& task : tasks) {
    for (const InstanceId id : task.targets) volumes[id].grid.FindOrAdd(task.index);
  }
  for_each_task([&](Task& task) { FuseActive(frame, config, T_CW, volumes, task); });
  for (auto& [id, volume] : volumes) volume.revision = NewRevision();
  std::vector<Index3> changed;
  for (const Task& task : tasks) {
    if (task.changed) changed.push_back(task.index);
  }
  return changed;
}

}  // namespace tsdfpp
