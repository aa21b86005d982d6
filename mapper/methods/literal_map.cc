#include "mapper/methods/literal_map.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "mapper/map_reach.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/rays/ray_pass.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/allocation.h"
#include "mapper/volume/freeing.h"

namespace tsdfpp {
namespace {

constexpr const char* kLists = "LIST";

constexpr std::size_t kBlocksPerTask = 16;

}  // namespace

std::unique_ptr<MapRepresentation> LiteralMap::Clone() const {
  return std::make_unique<LiteralMap>(*this);
}

std::vector<LiteralMap::Task> LiteralMap::PlanTasks(const FrameView& view,
                                                    const CameraFromLattice& T_CW) {
  const auto lattice_of = [&](InstanceId) -> LatticeOfLabel {
    return {Pose::Identity(), &index_.blocks().directory()};
  };
  for (const auto& [id, indices] : BlocksAlongRays(view, config_, lattice_of)) {
    for (const Index3& index : indices) index_.blocks().FindOrAdd(index);
  }
  std::vector<Task> tasks;
  tasks.reserve(index_.blocks().size());
  const auto sorted = index_.blocks().Sorted();
  const auto candidate_at = [&](std::size_t k) -> BlockCandidate {
    return {sorted[k]->index, &T_CW, kNoInstance, true};
  };
  for (const PlannedBlock& planned :
       PlanBlocks(view, sorted.size(), config_.voxel(), config_.back(), candidate_at)) {
    const auto* entry = sorted[planned.number];
    tasks.push_back({entry->index, entry->block.get(), planned, {}});
  }
  return tasks;
}

void LiteralMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  const FrameView view(frame, labels);
  const std::size_t blocks_before = index_.blocks().size();
  const CameraFromLattice T_CW(frame.T_WC, Pose::Identity(), true);
  std::vector<Task> tasks = PlanTasks(view, T_CW);
  const auto for_each_task = [&](const auto& function) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, tasks.size(), kBlocksPerTask),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) function(tasks[i]);
        },
        tbb::simple_partitioner());
  };
  for_each_task([&](Task& task) { Vote(view, T_CW, task); });
  for (const Task& task : tasks) {
    for (const InstanceId id : task.targets) volumes_[id].grid.FindOrAdd(task.index);
  }
  for_each_task([&](Task& task) { FuseActive(view, T_CW, task); });
  for (auto& [id, volume] : volumes_) volume.revision = NewRevision();
  std::vector<Index3> changed;
  for (const Task& task : tasks) {
    if (task.changed) changed.push_back(task.index);
  }
  field_.Note(changed, index_.blocks().size());
  // A frame empties no list; it may have made blocks in vain.
  index_.blocks().Erase(EmptyFrom(index_.blocks(), blocks_before,
                                  [](const PairIndex::Block& b) { return b.IsEmpty(); }));
  CheckInDebugBuilds(*this);
}

void LiteralMap::Vote(const FrameView& frame, const CameraFromLattice& T_CW, Task& task) const {
  BlockObservation observation;
  const BlockPlace place = PlaceOf(T_CW, task.index, config_.voxel(), task.planned);
  if (!ObserveVoxels(frame.kernel, place, config_.back(), observation)) return;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const std::int32_t pixel = observation.pixel[i];
    if (pixel < 0 || observation.distance[i] > config_.front()) continue;
    index_.Vote(*task.lists, i, frame.kernel.label[pixel]);
    const InstanceId active = task.lists->active[i].id;
    auto& targets = task.targets;
    const auto at = std::lower_bound(targets.begin(), targets.end(), active);
    if (at == targets.end() || *at != active) targets.insert(at, active);
  }
}

void LiteralMap::FuseActive(const FrameView& frame, const CameraFromLattice& T_CW, Task& task) {
  BlockObservation observation;
  const BlockPlace place = PlaceOf(T_CW, task.index, config_.voxel(), task.planned);
  if (!ObserveVoxels(frame.kernel, place, config_.back(), observation)) return;
  const auto weight_cap = static_cast<float>(config_.weight_cap);
  for (auto& [id, volume] : volumes_) {
    TsdfBlock* block = volume.grid.Find(task.index);
    if (block == nullptr) continue;
    bool changed = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      const std::int32_t pixel = observation.pixel[i];
      if (pixel < 0 || task.lists->active[i].id != id) continue;
      const float s = observation.distance[i];
      if (s <= config_.front()) {
        const bool coloured =
            std::abs(s) <=
            (block->ColourCount(i) == 0 ? config_.first_colour_band() : config_.colour_band());
        FuseVoxel(*block, i, s, coloured ? frame.kernel.colour + 3 * pixel : nullptr, weight_cap);
        changed = true;
      } else if (frame.kernel.label[pixel] == id) {
        FuseVoxel(*block, i, config_.front(), nullptr, weight_cap);
        changed = true;
      }
    }
    if (!changed) continue;
    block->UpdateMasks(config_.back());
    task.changed = true;
  }
}

void LiteralMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  field_.NoteAll();
  std::vector<Index3> left;
  if (!MoveValues(id, T_WO, [&] { left = index_.Deactivate(id); })) return;
  index_.Activate(id, volumes_.at(id).grid);
  index_.FreeEmpty(left);
  CheckInDebugBuilds(*this);
}

void LiteralMap::Remove(InstanceId id) {
  field_.NoteAll();
  index_.FreeEmpty(index_.Deactivate(id));
  volumes_.erase(id);
  CheckInDebugBuilds(*this);
}

Expected<void> LiteralMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Rename(from, to));
  field_.NoteAll();
  index_.Rename(from, to);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> LiteralMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                               const Pose& T_WO) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Add(id, volume, T_WL, T_WO));
  field_.NoteAll();
  index_.Activate(id, volumes_.at(id).grid);
  CheckInDebugBuilds(*this);
  return {};
}

SurfacesInBlocks LiteralMap::Surfaces() const {
  return {config_.voxel_m, VolumeSurfaces{&volumes_, nullptr},
          FieldSurface{&Field(), [this] { return ActiveLabels(index_); }}};
}

std::vector<RaySurface> LiteralMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                             const RayCastOptions& options) const {
  RayPass pass;
  pass.voxel_m = config_.voxel_m;
  pass.volumes.push_back({kBackground, &Field(), Pose::Identity(), true});
  pass.make_labels = [&] { return ActiveLabels(index_); };
  RayCastOptions first = options;
  first.surfaces = 1;
  return CastByRemoval(*this, RunRayPass(pass, camera, T_WC, first), camera, T_WC, options);
}

std::vector<Listing> LiteralMap::ListAt(const Eigen::Vector3i& voxel) const {
  return index_.ListedAt(ToIndex3(voxel));
}

std::vector<Eigen::Vector3i> LiteralMap::ListedVoxels() const {
  return SortedVoxels(index_.ListedVoxels());
}

MapMemory LiteralMap::Memory() const {
  MapMemory memory = ObjectVolumeMap::Memory();
  memory.blocks += index_.blocks().size();
  memory.bytes += index_.Bytes();
  memory.derived_bytes = field_.Bytes();
  return memory;
}

Fault LiteralMap::FindFault() const {
  std::size_t blocks = index_.blocks().size();
  if (Fault fault = FindVolumeFault(false, blocks)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  if (Fault fault = index_.FindFault(volumes_)) return fault;
  return FindListFault(*this);
}

void LiteralMap::Save(Sections& sections) const {
  ObjectVolumeMap::Save(sections);
  SaveLists(index_.Lists(), 2, sections[kLists]);
}

Expected<void> LiteralMap::Load(const Sections& sections) {
  field_.NoteAll();
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Load(sections));
  const auto is_observed = [this](InstanceId id, const Index3& index, int place) {
    const auto volume = volumes_.find(id);
    if (volume == volumes_.end()) return false;
    const TsdfBlock* block = volume->second.grid.Find(index);
    return block != nullptr && Bit(block->observed, place);
  };
  TSDFPP_ASSIGN(const auto lists, LoadAllLists(sections, kLists, 2, config_, is_observed));
  index_.SetLists(lists);
  return {};
}

}  // namespace tsdfpp
