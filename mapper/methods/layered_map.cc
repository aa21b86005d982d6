#include "mapper/methods/layered_map.h"

#include <algorithm>
#include <iterator>
#include <tuple>
#include <utility>

#include "mapper/mesh/mesh_tools.h"

namespace tsdfpp {

std::vector<Eigen::Vector3i> SortedVoxels(std::vector<Index3> voxels) {
  std::sort(voxels.begin(), voxels.end());
  std::vector<Eigen::Vector3i> sorted;
  sorted.reserve(voxels.size());
  for (const Index3& v : voxels) sorted.emplace_back(v.x, v.y, v.z);
  return sorted;
}

std::vector<Eigen::Vector3i> ObservedVoxelsOf(const TsdfGrid& grid) {
  std::vector<Index3> voxels;
  for (const auto& entry : grid.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (Bit(entry.block->observed, place)) voxels.push_back(VoxelAt(entry.index, place));
    }
  }
  return SortedVoxels(std::move(voxels));
}

std::optional<VoxelValue> ValueOf(const TsdfGrid& grid, const Index3& voxel) {
  const TsdfBlock* block = grid.Find(BlockOf(voxel));
  const int place = PlaceInBlock(voxel);
  const auto i = static_cast<std::size_t>(place);
  if (block == nullptr || block->weight[i] <= 0) return std::nullopt;
  return VoxelValue{block->distance[i], static_cast<float>(block->weight[i]),
                    block->ColourAt(place)};
}

ObjectMove LayeredMap::MoveTo(InstanceId id, const Pose& T_WO) const {
  ObjectMove move;
  const auto of = volumes_.find(id);
  if (of == volumes_.end() || !of->second.T_WO_birth) return move;
  const ObjectVolume& volume = of->second;
  if (SameNumbers(*volume.T_WO_birth, T_WO)) return move;
  if (SameNumbers(*volume.T_WO, T_WO)) {
    move.T_WL = volume.T_WL;
    return move;
  }
  move.T_WL = move.T = T_WO * volume.T_WO_birth->inverse();
  move.blocks = &volume.grid;
  return move;
}

std::map<InstanceId, Pose> LayeredMap::MovedLattices() const {
  std::map<InstanceId, Pose> lattices;
  for (const auto& [id, volume] : volumes_) {
    if (!volume.lattice_is_world) lattices.emplace(id, volume.T_WL);
  }
  return lattices;
}

std::vector<InstanceId> LayeredMap::Objects() const {
  std::vector<InstanceId> ids;
  for (const auto& [id, volume] : volumes_) {
    if (!volume.grid.empty()) ids.push_back(id);
  }
  return ids;
}

Pose LayeredMap::ObjectLattice(InstanceId id) const {
  const auto volume = volumes_.find(id);
  return volume == volumes_.end() ? Pose::Identity() : volume->second.T_WL;
}

MeshWork LayeredMap::UpdateObjectMesh(InstanceId id) const {
  return meshes_[id].Update(volumes_.at(id), config_.voxel());
}

TriangleMesh LayeredMap::ObjectMesh(InstanceId id) const {
  if (!volumes_.contains(id)) return {};
  UpdateObjectMesh(id);
  return Join({{&meshes_.at(id).mesh}});
}

void LayeredMap::NoteIndexChange(const Index3& block) const {
  // So many that it is cheaper not to tell them apart; nor may they pile up while nobody asks.
  constexpr std::size_t kMost = 4096;
  if (anything_may_be_hidden_) return;
  index_changes_.push_back(block);
  anything_may_be_hidden_ = index_changes_.size() > kMost;
}

MeshWork LayeredMap::UpdateMeshes() const {
  const std::size_t gone = std::erase_if(meshes_, [&](auto& mesh) {
    if (volumes_.contains(mesh.first)) return false;
    for (const Index3& block : mesh.second.mesh.ShownBlocks()) {
      gone_.parts.push_back({mesh.first, block, {}});
    }
    return true;
  });
  anything_may_be_hidden_ = anything_may_be_hidden_ || gone > 0 || meshes_.size() < volumes_.size();
  MeshWork work;
  bool is_same = !anything_may_be_hidden_ && index_changes_.empty();
  for (const auto& [id, volume] : volumes_) {
    work += UpdateObjectMesh(id);
    is_same = is_same && meshes_.at(id).changed.empty() && !meshes_.at(id).has_moved;
  }
  if (is_same) return work;
  const std::optional<VisibilityChanges> where = WhereVisibilityChanged();
  for (auto& [id, object] : meshes_) {
    if (!where) object.FindNegative();
  }
  FindHiddenTriangles(where);
  for (auto& [id, object] : meshes_) {
    object.changed.clear();
    object.has_moved = false;
  }
  index_changes_.clear();
  anything_may_be_hidden_ = false;
  return work;
}

// Who is active where changes with the index alone; how deep, with volumes and poses.
std::optional<LayeredMap::VisibilityChanges> LayeredMap::WhereVisibilityChanged() const {
  std::size_t blocks = 0;
  std::size_t changed = 0;
  for (const auto& [id, object] : meshes_) {
    blocks += object.mesh.parts().size();
    changed += object.has_moved ? object.mesh.parts().size() : object.changed.size();
  }
  if (anything_may_be_hidden_ || 4 * changed > blocks) return std::nullopt;
  if (!HasIndex()) return VisibilityChanges{};
  std::uint64_t whose = 0;
  InstanceId only = kNoInstance;
  std::vector<BlockBox> values;
  for (const auto& [id, object] : meshes_) {
    const auto add = [&, &of = object](const Index3& block) {
      // An interpolated distance reads a voxel further along each axis, from a point that is less
      // than a voxel from the one where a triangle is looked up.
      values.push_back(MovedBox({block, block, false}, of.lattice_is_world ? nullptr : &of.T_WL,
                                config_.voxel_m, 2));
    };
    if (object.has_moved) {
      for (const MeshPart* part : object.mesh.parts()) add(part->index);
    } else {
      for (const Index3& block : object.changed) add(block);
    }
    if (!object.has_moved && object.changed.empty()) continue;
    only = whose == 0 ? id : kNoInstance;
    whose |= IdBit(id);
  }
  std::vector<BlockBox> index;
  for (const Index3& block : index_changes_) index.push_back({block, block, false});
  auto index_set = BlockSet::Of(index, 0);
  auto value_set = BlockSet::Of(values, 0);
  index.insert(index.end(), values.begin(), values.end());
  auto near = BlockSet::Of(index, 1);
  if (!index_set || !value_set || !near) return std::nullopt;
  return VisibilityChanges{std::move(*index_set), std::move(*value_set), whose, only,
                           std::move(index),      std::move(*near)};
}

std::vector<MeshPart*> LayeredMap::PartsToLookUp(
    InstanceId id, PlacedMesh& object, const std::optional<VisibilityChanges>& where) const {
  std::vector<MeshPart*> parts = object.mesh.TakeUnsettled();
  if (!where || object.has_moved) return object.mesh.parts();
  // It does not hide itself.
  if (where->index.empty() && where->only == id) return parts;
  if (!where->near.Meets(ReachOf(object, config_.voxel_m))) return parts;
  // Moving the boxes to its lattice takes longer than asking all parts of a small object: a box has
  // eight corners.
  constexpr std::size_t kPartsABox = 8;
  const bool asks_all =
      !object.lattice_is_world && object.mesh.parts().size() < kPartsABox * where->all.size();
  // A triangle is looked up less than a block from its own.
  std::optional<BlockSet> near_in_lattice;
  if (!object.lattice_is_world && !asks_all) {
    const Pose T_LW = object.T_WL.inverse();
    std::vector<BlockBox> boxes;
    for (const BlockBox& box : where->all) {
      boxes.push_back(MovedBox(box, &T_LW, config_.voxel_m, 0));
    }
    near_in_lattice = BlockSet::Of(boxes, 1);
    if (!near_in_lattice) return object.mesh.parts();
  }
  const BlockSet& near = near_in_lattice ? *near_in_lattice : where->near;
  for (MeshPart* part : asks_all ? object.mesh.parts() : PartsIn(near, object.mesh)) {
    if (!part->is_settled) continue;
    // Where the index is as it was, the objects that are looked up are those that were.
    const bool others_changed = (part->others & where->whose) != 0;
    if (where->index.Meets(part->looked_up) ||
        (others_changed && where->values.Meets(part->looked_up))) {
      parts.push_back(part);
    }
  }
  return parts;
}

// A triangle is dropped where another object is active at its look-up voxel, and its look-up point
// deep enough in that object.
void LayeredMap::FindHiddenTriangles(const std::optional<VisibilityChanges>& where) const {
  struct Object {
    bool lattice_is_world;
    BlockBox reach;
    VoxelReader reader;
    Pose T_LW;
  };
  std::map<InstanceId, Object> objects;
  for (const auto& [id, volume] : volumes_) {
    objects.emplace(id, Object{volume.lattice_is_world, ReachOf(meshes_.at(id), config_.voxel_m),
                               VoxelReader(volume.grid), volume.T_WL.inverse()});
  }
  const float voxel = config_.voxel();
  const auto is_inside = [&](InstanceId id, const Eigen::Vector3f& point) {
    const Object& of = objects.at(id);
    const auto p = point.cast<double>();
    const Eigen::Vector3d q =
        of.lattice_is_world ? Eigen::Vector3d(p)
                            : Eigen::Vector3d(of.T_LW * (p * config_.voxel_m) / config_.voxel_m);
    const auto distance = DistanceAt(FindCorners(of.reader, q));
    return distance && *distance < -voxel;
  };
  for (auto& [self, object] : meshes_) {
    const auto place_of = [&, &of = object](const MeshPart& part) {
      return MovedBox({part.index, part.index, false}, of.lattice_is_world ? nullptr : &of.T_WL,
                      config_.voxel_m, 0);
    };
    const auto in_doubt = [&, id = self](const BlockBox& place) {
      return HasIndex() && std::any_of(objects.begin(), objects.end(), [&](const auto& other) {
               return other.first != id && other.second.reach.Meets(place);
             });
    };
    const auto hidden_at = [&, id = self](std::span<const LookUpPlace> look_ups,
                                          std::span<std::uint8_t> hidden) {
      std::uint64_t others = 0;
      // One voxel after another is in the same block.
      std::optional<Index3> last;
      const InstanceId* ids = nullptr;
      for (std::size_t i = 0; i < look_ups.size(); ++i) {
        const auto& [looked_up, point] = look_ups[i];
        const Index3 block = BlockOf(looked_up);
        if (last != block) ids = ActiveIn(block);
        last = block;
        const InstanceId active = ids == nullptr ? kNoInstance : ids[PlaceInBlock(looked_up)];
        const bool is_other = active != kNoInstance && active != id;
        if (is_other) others |= IdBit(active);
        hidden[i] = is_other && is_inside(active, point) ? 1 : 0;
      }
      return others;
    };
    object.mesh.NoteChanges(
        HideTriangles(PartsToLookUp(self, object, where), voxel, place_of, in_doubt, hidden_at));
    if (object.has_moved) object.mesh.NoteChanges(object.mesh.parts());
  }
}

TriangleMesh LayeredMap::SceneMesh() const {
  UpdateMeshes();
  std::vector<JoinedMesh> visible;
  for (const auto& [id, object] : meshes_) visible.push_back({&object.mesh, id, true});
  return Join(visible);
}

SceneChanges LayeredMap::TakeSceneChanges() const {
  SceneChanges changes;
  changes.work = UpdateMeshes();
  std::vector<ScenePiece>& parts = changes.parts;
  parts = std::exchange(gone_.parts, {});
  const bool any_gone = !parts.empty();
  for (auto& [id, object] : meshes_) {
    std::vector<ScenePiece> more = TakeScenePieces(object.mesh, {&object.mesh, id, true});
    std::move(more.begin(), more.end(), std::back_inserter(parts));
  }
  if (!any_gone) return changes;
  // An object of the same id may have come since, to the same blocks: the last word counts.
  const auto place = [](const ScenePiece& part) { return std::tie(part.id, part.block); };
  std::stable_sort(parts.begin(), parts.end(),
                   [&](const ScenePiece& a, const ScenePiece& b) { return place(a) < place(b); });
  const auto last =
      std::unique(parts.rbegin(), parts.rend(),
                  [&](const ScenePiece& a, const ScenePiece& b) { return place(a) == place(b); });
  parts.erase(parts.begin(), last.base());
  return changes;
}

const TsdfGrid* LayeredMap::GridOf(InstanceId id) const {
  const auto volume = volumes_.find(id);
  return volume == volumes_.end() ? nullptr : &volume->second.grid;
}

std::optional<VoxelValue> LayeredMap::ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return std::nullopt;
  return ValueOf(volume->second.grid, ToIndex3(voxel));
}

std::vector<Eigen::Vector3i> LayeredMap::ObservedVoxels(InstanceId id) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return {};
  return ObservedVoxelsOf(volume->second.grid);
}

MapMemory LayeredMap::VolumeMemory() const {
  MapMemory memory;
  for (const auto& [id, volume] : volumes_) {
    memory.blocks += volume.grid.size();
    memory.bytes += BytesOf(volume.grid);
  }
  for (const auto& [id, object] : meshes_) memory.mesh_bytes += object.mesh.Bytes();
  return memory;
}

}  // namespace tsdfpp
