#include "mapper/methods/literal_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mapper/map_reach.h"
#include "mapper/mesh/mesh_tools.h"
#include "mapper/mesh/scene_parts.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/layered_map.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/rays/ray_pass.h"
#include "mapper/volume/allocation.h"
#include "mapper/volume/freeing.h"
#include "mapper/volume/pull_back.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

std::unique_ptr<MapRepresentation> LiteralMap::Clone() const {
  return std::make_unique<LiteralMap>(*this);
}

void LiteralMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  const FrameView view(frame, labels);
  const auto lattice_of = [&](InstanceId) -> LatticeOfLabel {
    return {Pose::Identity(), &lists_.directory()};
  };
  const std::size_t blocks_before = lists_.size();
  for (const auto& [id, indices] : BlocksAlongRays(view, config_, lattice_of)) {
    for (const Index3& index : indices) lists_.FindOrAdd(index);
  }
  const CameraFromLattice T_CW(frame.T_WC, Pose::Identity(), true);
  std::vector<Task> tasks;
  tasks.reserve(lists_.size());
  const auto sorted = lists_.Sorted();
  const auto candidate_at = [&](std::size_t k) -> BlockCandidate {
    return {sorted[k]->index, &T_CW, kNoInstance, true};
  };
  for (const PlannedBlock& planned :
       PlanBlocks(view, sorted.size(), config_.voxel(), config_.back(), candidate_at)) {
    const auto* entry = sorted[planned.number];
    tasks.push_back({entry->index, entry->block.get(), planned, {}});
  }
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
  NoteFieldChange(tasks);
  // A frame empties no list; it may have made blocks in vain.
  lists_.Erase(EmptyFrom(lists_, blocks_before, [](const ListBlock& b) { return b.IsEmpty(); }));
  CheckInDebugBuilds(*this);
}

void LiteralMap::Vote(const FrameView& frame, const CameraFromLattice& T_CW, Task& task) const {
  BlockObservation observation;
  const BlockPlace place = PlaceOf(T_CW, task.index, config_.voxel(), task.planned);
  if (!ObserveVoxels(frame.kernel, place, config_.back(), observation)) return;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const std::int32_t pixel = observation.pixel[i];
    if (pixel < 0 || observation.distance[i] > config_.front()) continue;
    const InstanceId observed = frame.kernel.label[pixel];
    Entry& active = task.lists->active[i];
    const InstanceId before = active.id;
    if (active.id == observed) {
      if (active.confidence < config_.confidence_cap) ++active.confidence;
    } else if (active.id == kNoInstance || --active.confidence <= 0) {
      active = {observed, 1};
      if (task.lists->inactive[i].id == observed) task.lists->inactive[i] = {};
    }
    if (active.id != before) task.lists->revision = NewRevision();
    auto& targets = task.targets;
    const auto at = std::lower_bound(targets.begin(), targets.end(), active.id);
    if (at == targets.end() || *at != active.id) targets.insert(at, active.id);
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

bool LiteralMap::ListBlock::IsEmpty() const {
  return std::all_of(active.begin(), active.end(),
                     [](const Entry& entry) { return entry.id == kNoInstance; });
}

std::vector<Index3> LiteralMap::Unlist(InstanceId id) {
  std::vector<Index3> blocks;
  for (const auto& entry : lists_.entries()) {
    ListBlock& lists = *entry.block;
    bool listed = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (lists.active[i].id == id) {
        lists.revision = NewRevision();
        lists.active[i] = lists.inactive[i];
        lists.inactive[i] = {};
        listed = true;
      } else if (lists.inactive[i].id == id) {
        lists.inactive[i] = {};
      }
    }
    if (listed) blocks.push_back(entry.index);
  }
  return blocks;
}

void LiteralMap::FreeEmptyLists(const std::vector<Index3>& blocks) {
  std::vector<Index3> empty;
  for (const Index3& index : blocks) {
    if (lists_.Find(index)->IsEmpty()) empty.push_back(index);
  }
  lists_.Erase(empty);
}

ObjectMove LiteralMap::MoveTo(InstanceId id, const Pose& T_WO) const {
  const auto of = volumes_.find(id);
  return of == volumes_.end() ? ObjectMove{} : MoveOfValues(of->second, T_WO);
}

void LiteralMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  active_.all_are_stale = true;
  ObjectVolume& volume = volumes_[id];
  const std::optional<Pose> T_WO_old = std::exchange(volume.T_WO, T_WO);
  if (!T_WO_old || SameNumbers(*T_WO_old, T_WO)) return;
  const std::vector<Index3> left = Unlist(id);
  volume.grid = ResampleGrid(volume.grid, T_WO * T_WO_old->inverse(), config_.voxel_m,
                             config_.back(), config_.resampling);
  Activate(id);
  FreeEmptyLists(left);
  CheckInDebugBuilds(*this);
}

void LiteralMap::Activate(InstanceId id) {
  for (const auto& entry : volumes_.at(id).grid.entries()) {
    ListBlock& lists = lists_.FindOrAdd(entry.index);
    lists.revision = NewRevision();
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (!Bit(entry.block->observed, place)) continue;
      Entry& active = lists.active[At(place)];
      if (active.id != kNoInstance) lists.inactive[At(place)] = active;
      active = {id, static_cast<std::int16_t>(config_.moved_confidence)};
    }
  }
}

void LiteralMap::Remove(InstanceId id) {
  active_.all_are_stale = true;
  FreeEmptyLists(Unlist(id));
  volumes_.erase(id);
  CheckInDebugBuilds(*this);
}

std::vector<InstanceId> LiteralMap::Objects() const {
  std::vector<InstanceId> ids;
  for (const auto& [id, volume] : volumes_) {
    if (!volume.grid.empty()) ids.push_back(id);
  }
  return ids;
}

Pose LiteralMap::ObjectLattice(InstanceId) const { return Pose::Identity(); }

TriangleMesh LiteralMap::ObjectMesh(InstanceId id) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return {};
  GridMesh& mesh = object_meshes_[id];
  mesh.Update(volume->second.grid, config_.voxel());
  return Join({{&mesh}});
}

void LiteralMap::NoteFieldChange(const std::vector<Task>& tasks) {
  if (active_.all_are_stale) return;
  for (const Task& task : tasks) {
    if (task.changed) active_.stale.push_back(task.index);
  }
  // Nor may they pile up while nobody asks.
  active_.all_are_stale = active_.stale.size() > lists_.size();
}

// Brings the field of the active objects' values in line with lists and volumes.
void LiteralMap::UpdateActiveField() const {
  TsdfGrid& field = active_.field;
  std::vector<Index3> stale = std::exchange(active_.stale, {});
  if (std::exchange(active_.all_are_stale, false)) {
    stale.clear();
    for (const auto& entry : field.entries()) stale.push_back(entry.index);
    for (const auto& entry : lists_.entries()) stale.push_back(entry.index);
  }
  if (stale.empty()) return;
  std::sort(stale.begin(), stale.end());
  stale.erase(std::unique(stale.begin(), stale.end()), stale.end());
  std::vector<Index3> gone;
  std::erase_if(stale, [&](const Index3& index) {
    if (lists_.Find(index) != nullptr) return false;
    if (field.Find(index) != nullptr) gone.push_back(index);
    return true;
  });
  field.Erase(gone);
  active_.made_from.Erase(gone);
  for (const Index3& index : stale) {
    field.FindOrAdd(index);
    active_.made_from.FindOrAdd(index);
  }
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, stale.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const ListBlock& list = *lists_.Find(stale[i]);
          std::vector<std::uint64_t> from{list.revision};
          std::vector<const TsdfBlock*> of;
          for (const auto& [id, volume] : volumes_) {
            of.push_back(volume.grid.Find(stale[i]));
            from.push_back(of.back() == nullptr ? 0 : of.back()->revision);
          }
          std::vector<std::uint64_t>& made_from = *active_.made_from.Find(stale[i]);
          if (from == made_from) continue;
          made_from = std::move(from);
          TsdfBlock& block = *field.Find(stale[i]);
          block = {};
          auto source = of.begin();
          for (const auto& [id, volume] : volumes_) {
            const TsdfBlock* values = *source++;
            if (values == nullptr) continue;
            for (std::size_t k = 0; k < kBlockVoxels; ++k) {
              if (list.active[k].id != id) continue;
              block.distance[k] = values->distance[k];
              block.weight[k] = values->weight[k];
              block.SetColour(k, values->FixedColourAt(k), values->ColourCount(k));
            }
          }
          block.UpdateMasks(config_.back());
        }
      },
      tbb::simple_partitioner());
}

MeshWork LiteralMap::UpdateMeshes() const {
  UpdateActiveField();
  const MeshWork work = active_.mesh.Update(active_.field, config_.voxel());
  LabelTriangles(active_.mesh, config_.voxel(), [&] { return ActiveAtVoxels(); });
  return work;
}

VoxelLabels LiteralMap::ActiveAtVoxels() const {
  return LabelsOf(lists_,
                  [](const ListBlock& block, std::size_t place) { return block.active[place].id; });
}

std::vector<RaySurface> LiteralMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                             const RayCastOptions& options) const {
  UpdateActiveField();
  RayPass pass;
  pass.voxel_m = config_.voxel_m;
  pass.volumes.push_back({kBackground, &active_.field, Pose::Identity(), true});
  pass.make_labels = [&] { return ActiveAtVoxels(); };
  RayCastOptions first = options;
  first.surfaces = 1;
  return CastByRemoval(*this, RunRayPass(pass, camera, T_WC, first), camera, T_WC, options);
}

TriangleMesh LiteralMap::SceneMesh() const {
  UpdateMeshes();
  return Join({{&active_.mesh}});
}

SceneChanges LiteralMap::TakeSceneChanges() const {
  const MeshWork work = UpdateMeshes();
  return {TakeScenePieces(active_.mesh, {&active_.mesh}), work};
}

const TsdfGrid* LiteralMap::GridOf(InstanceId id) const {
  const auto volume = volumes_.find(id);
  return volume == volumes_.end() ? nullptr : &volume->second.grid;
}

std::optional<VoxelValue> LiteralMap::ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return std::nullopt;
  return ValueOf(volume->second.grid, ToIndex3(voxel));
}

std::vector<Listing> LiteralMap::ListAt(const Eigen::Vector3i& voxel) const {
  std::vector<Listing> listings;
  const ListBlock* lists = lists_.Find(BlockOf(ToIndex3(voxel)));
  if (lists == nullptr) return listings;
  const std::size_t i = At(PlaceInBlock(ToIndex3(voxel)));
  for (const Entry& entry : {lists->active[i], lists->inactive[i]}) {
    if (entry.id != kNoInstance) listings.push_back({entry.id, entry.confidence});
  }
  return listings;
}

std::vector<Eigen::Vector3i> LiteralMap::ObservedVoxels(InstanceId id) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return {};
  return ObservedVoxelsOf(volume->second.grid);
}

std::vector<Eigen::Vector3i> LiteralMap::ListedVoxels() const {
  std::vector<Index3> voxels;
  for (const auto& entry : lists_.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (entry.block->active[At(place)].id != kNoInstance) {
        voxels.push_back(VoxelAt(entry.index, place));
      }
    }
  }
  return SortedVoxels(std::move(voxels));
}

MapMemory LiteralMap::Memory() const {
  MapMemory memory{lists_.size(), lists_.size() * sizeof(ListBlock) + lists_.TableBytes()};
  for (const auto& [id, volume] : volumes_) {
    memory.blocks += volume.grid.size();
    memory.bytes += BytesOf(volume.grid);
  }
  memory.mesh_bytes = BytesOf(active_.field) - active_.field.TableBytes() + active_.mesh.Bytes();
  for (const auto& [id, mesh] : object_meshes_) memory.mesh_bytes += mesh.Bytes();
  return memory;
}

}  // namespace tsdfpp
