#include "mapper/literal_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>

#include "mapper/allocation.h"
#include "mapper/layered_map.h"
#include "mapper/marching_cubes.h"
#include "mapper/mesh_tools.h"
#include "mapper/pull_back.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

std::unique_ptr<MapRepresentation> LiteralMap::Clone() const {
  return std::make_unique<LiteralMap>(*this);
}

void LiteralMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  const FrameView view(frame, labels);
  const auto world = [](InstanceId) { return Pose::Identity(); };
  const auto is_known = [&](InstanceId, const Index3& index) {
    return lists_.Find(index) != nullptr;
  };
  for (const auto& [id, indices] : BlocksAlongRays(view, config_, world, is_known)) {
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
    tasks.push_back({entry->index, entry->block.get(), {}});
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
}

void LiteralMap::Vote(const FrameView& frame, const CameraFromLattice& T_CW, Task& task) const {
  BlockObservation observation;
  const BlockPlace place = PlaceOf(T_CW, task.index, config_.voxel());
  if (!ObserveVoxels(frame.kernel, place, config_.back(), observation)) return;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const std::int32_t pixel = observation.pixel[i];
    if (pixel < 0 || observation.distance[i] > config_.front()) continue;
    const InstanceId observed = frame.kernel.label[pixel];
    Entry& active = task.lists->active[i];
    if (active.id == observed) {
      if (active.confidence < config_.confidence_cap) ++active.confidence;
    } else if (active.id == kNoInstance || --active.confidence <= 0) {
      active = {observed, 1};
      if (task.lists->inactive[i].id == observed) task.lists->inactive[i] = {};
    }
    auto& targets = task.targets;
    const auto at = std::lower_bound(targets.begin(), targets.end(), active.id);
    if (at == targets.end() || *at != active.id) targets.insert(at, active.id);
  }
}

void LiteralMap::FuseActive(const FrameView& frame, const CameraFromLattice& T_CW,
                            const Task& task) {
  BlockObservation observation;
  const BlockPlace place = PlaceOf(T_CW, task.index, config_.voxel());
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
        const bool coloured = block->colour_count[i] == 0 || std::abs(s) <= config_.colour_band();
        FuseVoxel(*block, i, s, coloured ? frame.kernel.colour + 3 * pixel : nullptr, weight_cap);
        changed = true;
      } else if (frame.kernel.label[pixel] == id) {
        FuseVoxel(*block, i, config_.front(), nullptr, weight_cap);
        changed = true;
      }
    }
    if (changed) block->UpdateMasks(config_.back());
  }
}

void LiteralMap::Unlist(InstanceId id) {
  for (const auto& entry : lists_.entries()) {
    ListBlock& lists = *entry.block;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (lists.active[i].id == id) {
        lists.active[i] = lists.inactive[i];
        lists.inactive[i] = {};
      } else if (lists.inactive[i].id == id) {
        lists.inactive[i] = {};
      }
    }
  }
}

void LiteralMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  ObjectVolume& volume = volumes_[id];
  const std::optional<Pose> T_WO_old = std::exchange(volume.T_WO, T_WO);
  if (!T_WO_old || SameNumbers(*T_WO_old, T_WO)) return;
  Unlist(id);
  volume.grid =
      ResampleGrid(volume.grid, T_WO * T_WO_old->inverse(), config_.voxel_m, config_.back());
  for (const auto& entry : volume.grid.entries()) {
    ListBlock& lists = lists_.FindOrAdd(entry.index);
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (!Bit(entry.block->observed, place)) continue;
      Entry& active = lists.active[At(place)];
      if (active.id != kNoInstance) lists.inactive[At(place)] = active;
      active = {id, static_cast<std::int16_t>(config_.moved_confidence)};
    }
  }
}

void LiteralMap::Remove(InstanceId id) {
  Unlist(id);
  volumes_.erase(id);
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
  return volume == volumes_.end() ? TriangleMesh{}
                                  : ExtractMesh(volume->second.grid, config_.voxel());
}

TriangleMesh LiteralMap::SceneMesh() const {
  TsdfGrid field;
  for (const auto* entry : lists_.Sorted()) {
    auto block = std::make_unique<TsdfBlock>();
    for (const auto& [id, volume] : volumes_) {
      const TsdfBlock* of = volume.grid.Find(entry->index);
      if (of == nullptr) continue;
      for (std::size_t i = 0; i < kBlockVoxels; ++i) {
        if (entry->block->active[i].id != id) continue;
        block->distance[i] = of->distance[i];
        block->weight[i] = of->weight[i];
        block->SetColour(i, of->FixedColourAt(i), of->colour_count[i]);
      }
    }
    block->UpdateMasks(config_.back());
    field.Add(entry->index, std::move(block));
  }
  TriangleMesh mesh = ExtractMesh(field, config_.voxel());
  mesh.face_ids.reserve(mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    const Index3 v = NearestVoxel(
        (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0F, config_.voxel());
    const ListBlock* lists = lists_.Find(BlockOf(v));
    const InstanceId id = lists == nullptr ? kNoInstance : lists->active[At(PlaceInBlock(v))].id;
    mesh.face_ids.push_back(id == kNoInstance ? kBackground : id);
  }
  return mesh;
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
    memory.bytes += volume.grid.size() * sizeof(TsdfBlock) + volume.grid.TableBytes();
  }
  return memory;
}

}  // namespace tsdfpp
