#include "mapper/mesh/volume_meshes.h"

#include <algorithm>
#include <iterator>
#include <tuple>
#include <utility>

#include "mapper/mesh/join_parts.h"

namespace tsdfpp {

bool VolumeMeshes::DropGone(const ObjectVolumes& volumes) {
  const std::size_t gone = std::erase_if(meshes_, [&](auto& mesh) {
    if (volumes.contains(mesh.first)) return false;
    for (const Index3& block : mesh.second.mesh.ShownBlocks()) {
      gone_.push_back({mesh.first, block, {}});
    }
    return true;
  });
  return gone > 0;
}

MeshWork VolumeMeshes::Update(const VolumeSurfaces& surfaces, double voxel_m) {
  const ObjectVolumes& volumes = *surfaces.volumes;
  const bool others = DropGone(volumes) || meshes_.size() < volumes.size();
  // Without an index nothing changes in it.
  std::optional<std::vector<Index3>> index_changes(std::in_place);
  if (surfaces.index != nullptr) index_changes = surfaces.index->changes().ReadFrom(index_read_);
  if (others) index_changes.reset();
  MeshWork work;
  bool is_same = index_changes && index_changes->empty();
  for (const auto& [id, volume] : volumes) {
    PlacedMesh& object = meshes_[id];
    work += object.Update(volume, static_cast<float>(voxel_m));
    is_same = is_same && object.changed.empty() && !object.has_moved;
  }
  if (is_same) return work;
  std::optional<VisibilityChanges> where;
  if (index_changes && surfaces.index != nullptr) {
    where = WhereVisibilityChanged(*index_changes, voxel_m);
  } else if (index_changes) {
    where.emplace();
  }
  for (auto& [id, object] : meshes_) {
    if (!where) object.FindNegative();
  }
  FindHiddenTriangles(surfaces, voxel_m, where);
  for (auto& [id, object] : meshes_) {
    object.changed.clear();
    object.has_moved = false;
  }
  return work;
}

// Who is active where changes with the index alone; how deep, with volumes and poses.
std::optional<VolumeMeshes::VisibilityChanges> VolumeMeshes::WhereVisibilityChanged(
    const std::vector<Index3>& index_changes, double voxel_m) const {
  std::size_t blocks = 0;
  std::size_t changed = 0;
  for (const auto& [id, object] : meshes_) {
    blocks += object.mesh.parts().size();
    changed += object.has_moved ? object.mesh.parts().size() : object.changed.size();
  }
  if (4 * changed > blocks) return std::nullopt;
  std::uint64_t whose = 0;
  InstanceId only = kNoInstance;
  std::vector<BlockBox> values;
  for (const auto& [id, object] : meshes_) {
    const auto add = [&, &of = object](const Index3& block) {
      // An interpolated distance reads a voxel further along each axis, from a point that is less
      // than a voxel from the one where a triangle is looked up.
      values.push_back(
          MovedBox({block, block, false}, of.lattice_is_world ? nullptr : &of.T_WL, voxel_m, 2));
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
  index.reserve(index_changes.size());
  for (const Index3& block : index_changes) index.push_back({block, block, false});
  auto index_set = BlockSet::Of(index, 0);
  auto value_set = BlockSet::Of(values, 0);
  index.insert(index.end(), values.begin(), values.end());
  auto near = BlockSet::Of(index, 1);
  if (!index_set || !value_set || !near) return std::nullopt;
  return VisibilityChanges{std::move(*index_set), std::move(*value_set), whose, only,
                           std::move(index),      std::move(*near)};
}

std::vector<MeshPart*> VolumeMeshes::PartsToLookUp(InstanceId id, PlacedMesh& object,
                                                   const std::optional<VisibilityChanges>& where,
                                                   double voxel_m) {
  std::vector<MeshPart*> parts = object.mesh.TakeUnsettled();
  if (!where || object.has_moved) return object.mesh.parts();
  // It does not hide itself.
  if (where->index.empty() && where->only == id) return parts;
  if (!where->near.Meets(ReachOf(object, voxel_m))) return parts;
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
      boxes.push_back(MovedBox(box, &T_LW, voxel_m, 0));
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
void VolumeMeshes::FindHiddenTriangles(const VolumeSurfaces& surfaces, double voxel_m,
                                       const std::optional<VisibilityChanges>& where) {
  struct Object {
    bool lattice_is_world;
    BlockBox reach;
    VoxelReader reader;
    Pose T_LW;
  };
  std::map<InstanceId, Object> objects;
  for (const auto& [id, volume] : *surfaces.volumes) {
    objects.emplace(id, Object{volume.lattice_is_world, ReachOf(meshes_.at(id), voxel_m),
                               VoxelReader(volume.grid), volume.T_WL.inverse()});
  }
  const float voxel = static_cast<float>(voxel_m);
  const auto is_inside = [&](InstanceId id, const Eigen::Vector3f& point) {
    const Object& of = objects.at(id);
    const auto p = point.cast<double>();
    const Eigen::Vector3d q = of.lattice_is_world
                                  ? Eigen::Vector3d(p)
                                  : Eigen::Vector3d(of.T_LW * (p * voxel_m) / voxel_m);
    const auto distance = DistanceAt(FindCorners(of.reader, q));
    return distance && *distance < -voxel;
  };
  for (auto& [self, object] : meshes_) {
    const auto place_of = [&, &of = object](const MeshPart& part) {
      return MovedBox({part.index, part.index, false}, of.lattice_is_world ? nullptr : &of.T_WL,
                      voxel_m, 0);
    };
    const auto in_doubt = [&, id = self](const BlockBox& place) {
      return surfaces.index != nullptr &&
             std::any_of(objects.begin(), objects.end(), [&](const auto& other) {
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
        if (last != block) ids = surfaces.index->ActiveIn(block);
        last = block;
        const InstanceId active = ids == nullptr ? kNoInstance : ids[PlaceInBlock(looked_up)];
        const bool is_other = active != kNoInstance && active != id;
        if (is_other) others |= IdBit(active);
        hidden[i] = is_other && is_inside(active, point) ? 1 : 0;
      }
      return others;
    };
    object.mesh.NoteChanges(HideTriangles(PartsToLookUp(self, object, where, voxel_m), voxel,
                                          place_of, in_doubt, hidden_at));
    if (object.has_moved) object.mesh.NoteChanges(object.mesh.parts());
  }
}

TriangleMesh VolumeMeshes::Scene() const {
  std::vector<JoinedMesh> visible;
  for (const auto& [id, object] : meshes_) visible.push_back({&object.mesh, id, true});
  return Join(visible);
}

std::vector<ScenePiece> VolumeMeshes::TakeChanges() {
  std::vector<ScenePiece> parts = std::exchange(gone_, {});
  const bool any_gone = !parts.empty();
  for (auto& [id, object] : meshes_) {
    std::vector<ScenePiece> more = TakeScenePieces(object.mesh, {&object.mesh, id, true});
    std::move(more.begin(), more.end(), std::back_inserter(parts));
  }
  if (!any_gone) return parts;
  // An object of the same id may have come since, to the same blocks: the last word counts.
  const auto place = [](const ScenePiece& part) { return std::tie(part.id, part.block); };
  std::stable_sort(parts.begin(), parts.end(),
                   [&](const ScenePiece& a, const ScenePiece& b) { return place(a) < place(b); });
  const auto last =
      std::unique(parts.rbegin(), parts.rend(),
                  [&](const ScenePiece& a, const ScenePiece& b) { return place(a) == place(b); });
  parts.erase(parts.begin(), last.base());
  return parts;
}

TriangleMesh VolumeMeshes::Object(const VolumeSurfaces& surfaces, double voxel_m, InstanceId id) {
  const auto volume = surfaces.volumes->find(id);
  if (volume == surfaces.volumes->end()) return {};
  PlacedMesh& object = meshes_[id];
  object.Update(volume->second, static_cast<float>(voxel_m));
  return Join({{&object.mesh}});
}

std::size_t VolumeMeshes::Bytes() const {
  std::size_t bytes = 0;
  for (const auto& [id, object] : meshes_) bytes += object.mesh.Bytes();
  return bytes;
}

}  // namespace tsdfpp
