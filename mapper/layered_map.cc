#include "mapper/layered_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <iterator>
#include <tuple>
#include <utility>

#include "mapper/mesh_tools.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 64;
constexpr std::size_t kCoversPerTask = 64;
constexpr std::size_t kCoversAhead = 3;  // more than a few do not stay in the cache

}  // namespace

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
  const ObjectVolume& volume = volumes_.at(id);
  return meshes_[id].Update(volume.grid, config_.voxel(), volume.T_WL, volume.lattice_is_world);
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
  std::vector<BlockBox> values;
  for (const auto& [id, object] : meshes_) {
    const auto add = [&, &of = object](const Index3& block) {
      // An interpolated distance reads a voxel further along each axis.
      const bool is_world = of.lattice_is_world;
      values.push_back(MovedBox({block, block, false}, is_world ? nullptr : &of.T_WL,
                                config_.voxel_m, is_world ? 0 : 1));
    };
    if (object.has_moved) {
      for (const MeshPart* part : object.mesh.parts()) add(part->index);
    } else {
      for (const Index3& block : object.changed) add(block);
    }
    if (object.has_moved || !object.changed.empty()) whose |= IdBit(id);
  }
  std::vector<BlockBox> index;
  for (const Index3& block : index_changes_) index.push_back({block, block, false});
  auto index_set = BlockSet::Of(index, 0);
  auto value_set = BlockSet::Of(values, 0);
  index.insert(index.end(), values.begin(), values.end());
  auto near = BlockSet::Of(index, 1);
  if (!index_set || !value_set || !near) return std::nullopt;
  return VisibilityChanges{std::move(*index_set), std::move(*value_set), whose, std::move(index),
                           std::move(*near)};
}

std::vector<MeshPart*> LayeredMap::PartsToLookUp(
    PlacedMesh& object, const std::optional<VisibilityChanges>& where) const {
  std::vector<MeshPart*> parts = object.mesh.TakeUnsettled();
  if (!where || object.has_moved) return object.mesh.parts();
  // A triangle is looked up less than a block from its own.
  std::optional<BlockSet> near_in_lattice;
  if (!object.lattice_is_world) {
    const Pose T_LW = object.T_WL.inverse();
    std::vector<BlockBox> boxes;
    for (const BlockBox& box : where->all) {
      boxes.push_back(MovedBox(box, &T_LW, config_.voxel_m, 0));
    }
    near_in_lattice = BlockSet::Of(boxes, 1);
    if (!near_in_lattice) return object.mesh.parts();
  }
  const BlockSet& near = near_in_lattice ? *near_in_lattice : where->near;
  for (MeshPart* part : near.PartsOf(object.mesh)) {
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

// A triangle is dropped where another object is active at its look-up voxel, deep enough.
void LayeredMap::FindHiddenTriangles(const std::optional<VisibilityChanges>& where) const {
  struct Object {
    const TsdfGrid* grid;
    bool lattice_is_world;
    BlockBox reach;
    std::optional<VoxelReader> reader;  // unless the lattice is the world's
    Pose T_LW;
  };
  std::map<InstanceId, Object> objects;
  for (const auto& [id, volume] : volumes_) {
    const bool is_world = volume.lattice_is_world;
    Object object{&volume.grid,
                  is_world,
                  ReachOf(meshes_.at(id), config_.voxel_m),
                  {},
                  volume.T_WL.inverse()};
    if (!is_world) object.reader.emplace(volume.grid);
    objects.emplace(id, std::move(object));
  }
  const float voxel = config_.voxel();
  const auto is_inside = [&](InstanceId id, const Index3& v) {
    const Object& of = objects.at(id);
    if (of.lattice_is_world) {
      const TsdfBlock* block = of.grid->Find(BlockOf(v));
      const auto i = static_cast<std::size_t>(PlaceInBlock(v));
      return block != nullptr && block->weight[i] > 0 && block->distance[i] < -voxel;
    }
    const Eigen::Vector3d q =
        of.T_LW * (Eigen::Vector3d(v.x, v.y, v.z) * config_.voxel_m) / config_.voxel_m;
    const auto distance = DistanceAt(FindCorners(*of.reader, q));
    return distance && *distance < -voxel;
  };
  for (auto& [self, object] : meshes_) {
    const auto in_doubt = [&, id = self, is_world = object.lattice_is_world](const MeshPart& part) {
      return HasIndex() && std::any_of(objects.begin(), objects.end(), [&](const auto& other) {
               return other.first != id && (!is_world || other.second.reach.Holds(part.index));
             });
    };
    const auto hidden_at = [&, id = self](std::span<const Index3> voxels,
                                          std::span<std::uint8_t> hidden) {
      std::uint64_t others = 0;
      // One voxel after another is in the same block.
      std::optional<Index3> last;
      const InstanceId* ids = nullptr;
      for (std::size_t i = 0; i < voxels.size(); ++i) {
        const Index3 block = BlockOf(voxels[i]);
        if (last != block) ids = ActiveIn(block);
        last = block;
        const InstanceId active = ids == nullptr ? kNoInstance : ids[PlaceInBlock(voxels[i])];
        const bool is_other = active != kNoInstance && active != id;
        if (is_other) others |= IdBit(active);
        hidden[i] = is_other && is_inside(active, voxels[i]) ? 1 : 0;
      }
      return others;
    };
    object.mesh.NoteChanges(
        HideTriangles(PartsToLookUp(object, where), voxel, in_doubt, hidden_at));
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

std::vector<LayeredMap::StaleCover> LayeredMap::StaleCovers(
    const std::vector<FusedBlock>& fused) const {
  struct Marks {
    const TsdfGrid* grid;
    std::vector<std::atomic<bool>> of_entry;
  };
  std::map<InstanceId, Marks> marks;
  for (const auto& [id, volume] : volumes_) {
    if (!volume.lattice_is_world) continue;
    marks.try_emplace(id, Marks{&volume.grid, std::vector<std::atomic<bool>>(volume.grid.size())});
  }
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, fused.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const FusedBlock& from = fused[i];
          const auto of = marks.find(from.id);
          if (from.touched == 0 || of == marks.end()) continue;
          const auto numbers = of->second.grid->directory().FindAround(from.index);
          for (std::uint32_t bits = from.touched; bits != 0; bits &= bits - 1) {
            const std::int32_t number = numbers[static_cast<std::size_t>(std::countr_zero(bits))];
            if (number == BlockDirectory::kNone) continue;
            of->second.of_entry[static_cast<std::size_t>(number)].store(true,
                                                                        std::memory_order_relaxed);
          }
        }
      },
      tbb::simple_partitioner());
  std::vector<StaleCover> stale;
  for (const auto& [id, of] : marks) {
    for (std::size_t i = 0; i < of.of_entry.size(); ++i) {
      if (!of.of_entry[i].load(std::memory_order_relaxed)) continue;
      const auto& entry = of.grid->entries()[i];
      stale.push_back({id, entry.index, entry.block.get(), of.grid});
    }
  }
  return stale;
}

std::vector<BlockMask> LayeredMap::NewCovers(const std::vector<StaleCover>& stale) {
  std::vector<BlockMask> covers(stale.size());
  // Covers read the neighbours' values, which no longer change.
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, stale.size(), kCoversPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        // What is found is fetched while the ones before are worked on.
        std::array<Surroundings, kCoversAhead> around;
        const auto find = [&](std::size_t i) {
          if (i >= range.end()) return;
          around[i % kCoversAhead] = FindSurroundings(*stale[i].grid, stale[i].index);
        };
        for (std::size_t i = range.begin(); i < range.begin() + kCoversAhead; ++i) find(i);
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          covers[i] = CoverOf(around[i % kCoversAhead]);
          find(i + kCoversAhead);
        }
      },
      tbb::simple_partitioner());
  return covers;
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
