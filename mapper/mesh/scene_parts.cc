#include "mapper/mesh/scene_parts.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapper/mesh/mesh_tools.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kPartsPerTask = 8;
constexpr std::uint16_t kUsed = 0;

template <typename Function>
void ForEachPart(const std::vector<MeshPart*>& parts, const Function& function) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, parts.size(), kPartsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) function(*parts[i]);
      },
      tbb::simple_partitioner());
}

// The positions in the world of the vertices that a part's triangles name.
class CornersOf {
 public:
  explicit CornersOf(const MeshPart& part) {
    for (std::size_t which = 0; which < 8; ++which) {
      const MeshPart* near = part.around[UpperPlace(which)];
      if (near != nullptr) positions_[which] = near->PositionsInWorld().data();
    }
  }
  const Eigen::Vector3f& operator()(std::uint16_t name) const {
    return positions_[name >> kLocalVertexBits][name & kLocalVertexMask];
  }

 private:
  std::array<const Eigen::Vector3f*, 8> positions_{};
};

// Where the part's triangles are looked up. Returns a box around the voxels.
BlockBox FindLookUps(const MeshPart& part, float voxel, std::vector<LookUpPlace>& look_ups) {
  constexpr int kMost = std::numeric_limits<int>::max();
  constexpr std::size_t kAtOnce = 64;
  using Numbers = std::array<float, kAtOnce>;
  const float per_voxel = 1 / voxel;
  const CornersOf corner(part);
  Index3 low{kMost, kMost, kMost};
  Index3 high{-kMost, -kMost, -kMost};
  look_ups.resize(part.triangles.size());
  std::array<std::array<Numbers, 3>, 3> at;  // coordinates of the corners, by axis
  std::array<std::array<int, kAtOnce>, 3> found;
  std::array<Numbers, 3> point;
  for (std::size_t first = 0; first < part.triangles.size(); first += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, part.triangles.size() - first);
    for (std::size_t t = 0; t < count; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3f& p_W = corner(part.triangles[first + t][k]);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          at[axis][k][t] = p_W[static_cast<Eigen::Index>(axis)];
        }
      }
    }
    // Compilers make vectors of this.
    for (std::size_t t = 0; t < count; ++t) {
      const auto of = [&](std::size_t axis, std::size_t k) { return at[axis][k][t] * per_voxel; };
      const auto side = [&](std::size_t axis, std::size_t k) { return of(axis, k) - of(axis, 0); };
      const auto normal = [&](std::size_t axis) {
        const std::size_t u = (axis + 1) % 3;
        const std::size_t v = (axis + 2) % 3;
        return side(u, 1) * side(v, 2) - side(v, 1) * side(u, 2);
      };
      const float squared = normal(0) * normal(0) + (normal(1) * normal(1) + normal(2) * normal(2));
      const float half = squared > 0 ? 0.5F / std::sqrt(squared) : 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float centroid = (of(axis, 0) + of(axis, 1) + of(axis, 2)) * (1.0F / 3);
        point[axis][t] = centroid + half * normal(axis);
        found[axis][t] = NearestAlong(point[axis][t], 1);
      }
    }
    for (std::size_t t = 0; t < count; ++t) {
      const Index3 v{found[0][t], found[1][t], found[2][t]};
      low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
      high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
      look_ups[first + t] = {v, {point[0][t], point[1][t], point[2][t]}};
    }
  }
  return {low, high, false};
}

// Numbers the vertices of a part that some visible triangle names.
void RenameVertices(MeshPart& part) {
  part.renamed.clear();
  if (part.positions.empty()) return;
  bool any_hidden = false;
  for (std::size_t which = 0; which < 8; ++which) {
    const MeshPart* user = part.around[LowerPlace(which)];
    any_hidden = any_hidden || (user != nullptr && !user->hidden.empty());
  }
  if (!any_hidden) return;
  part.renamed.assign(part.positions.size(), kNotShown);
  for (std::size_t which = 0; which < 8; ++which) {
    const MeshPart* user = part.around[LowerPlace(which)];
    if (user == nullptr) continue;
    for (std::size_t t = 0; t < user->triangles.size(); ++t) {
      if (!user->hidden.empty() && user->hidden[t] != 0) continue;
      for (const std::uint16_t corner : user->triangles[t]) {
        if (corner >> kLocalVertexBits == which) part.renamed[corner & kLocalVertexMask] = kUsed;
      }
    }
  }
  part.visible_vertices = 0;
  for (std::uint16_t& name : part.renamed) {
    if (name == kUsed) name = static_cast<std::uint16_t>(part.visible_vertices++);
  }
}

}  // namespace

MeshWork PlacedMesh::Update(const ObjectVolume& volume, float voxel) {
  const bool moves = !SameNumbers(T_WL, volume.T_WL) || lattice_is_world != volume.lattice_is_world;
  T_WL = volume.T_WL;
  lattice_is_world = volume.lattice_is_world;
  has_moved = has_moved || moves;
  const MeshWork work = mesh.Update(volume.grid, voxel, volume.revision);
  // Nor may they pile up while nobody resets them: where room runs out, each is kept once.
  if (changed.size() + mesh.changed().size() > changed.capacity()) {
    std::sort(changed.begin(), changed.end());
    changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
    changed.reserve(2 * (changed.size() + mesh.changed().size()));
  }
  changed.insert(changed.end(), mesh.changed().begin(), mesh.changed().end());
  for (const Index3& index : mesh.changed()) {
    const MeshPart* part = mesh.PartAt(index);
    if (part != nullptr && part->any_negative) negative.Extend(index);
  }
  ForEachPart(moves ? mesh.parts() : mesh.remade(), [&](MeshPart& part) {
    part.placed.clear();
    if (lattice_is_world) return;
    part.placed.reserve(part.positions.size());
    for (const Eigen::Vector3f& p : part.positions) {
      part.placed.push_back((T_WL * p.cast<double>()).cast<float>());
    }
  });
  return work;
}

void PlacedMesh::FindNegative() {
  negative = {};
  for (const MeshPart* part : mesh.parts()) {
    if (part->any_negative) negative.Extend(part->index);
  }
}

BlockBox ReachOf(const PlacedMesh& object, double voxel_m) {
  // What is covered is at most a voxel from a negative one, and a look-up voxel at most two from
  // the block of its triangle: not as much as a block together.
  return MovedBox(object.negative, object.lattice_is_world ? nullptr : &object.T_WL, voxel_m,
                  kBlockSide);
}

std::vector<MeshPart*> PartsIn(const BlockSet& blocks, const GridMesh& mesh) {
  std::vector<MeshPart*> parts;
  if (blocks.bounds().is_empty) return parts;
  const std::vector<std::uint64_t>& keys = mesh.keys();
  auto key = keys.begin();
  // Boxes that were moved may reach beyond what can be packed; no part is there.
  const auto clamped = [](const Index3& index) {
    const auto along = [](int i) { return std::clamp(i, -kFurthestStored, kFurthestStored); };
    return Index3{along(index.x), along(index.y), along(index.z)};
  };
  const Index3 low = clamped(blocks.bounds().low);
  const Index3 high = clamped(blocks.bounds().high);
  for (int z = low.z; z <= high.z; ++z) {
    for (int y = low.y; y <= high.y; ++y) {
      const std::uint64_t first = PackIndex({low.x, y, z});
      const std::uint64_t last = PackIndex({high.x, y, z});
      if (key != keys.end() && *key < first) key = std::lower_bound(key, keys.end(), first);
      for (; key != keys.end() && *key <= last; ++key) {
        if (!blocks.Holds(UnpackIndex(*key))) continue;
        parts.push_back(mesh.parts()[static_cast<std::size_t>(key - keys.begin())]);
      }
    }
  }
  return parts;
}

void LabelTriangles(GridMesh& mesh, float voxel, const std::function<VoxelLabels()>& make_labels) {
  const std::vector<MeshPart*> unsettled = mesh.TakeUnsettled();
  mesh.NoteChanges(unsettled);
  ForEachPart(unsettled, [&](MeshPart& part) {
    part.is_settled = true;
    part.face_ids.resize(part.triangles.size());
    if (part.triangles.empty()) return;
    thread_local std::vector<Index3> voxels;
    voxels.clear();
    const CornersOf corner(part);
    for (const auto& [a, b, c] : part.triangles) {
      voxels.push_back(NearestVoxel((corner(a) + corner(b) + corner(c)) / 3.0F, voxel));
    }
    make_labels()(voxels, part.face_ids);
  });
}

std::vector<MeshPart*> HideTriangles(const std::vector<MeshPart*>& parts, float voxel,
                                     const std::function<BlockBox(const MeshPart&)>& place_of,
                                     const std::function<bool(const BlockBox&)>& in_doubt,
                                     const HiddenAt& hidden_at) {
  // Vertices are named by the triangles of the part and of the lower ones around it: where these
  // are others, or others are hidden, the part's vertices are numbered again.
  constexpr std::uint32_t kNamesChanged = 1;
  constexpr std::uint32_t kToBeNamed = 2;
  ForEachPart(parts, [&](MeshPart& part) {
    thread_local std::vector<LookUpPlace> look_ups;
    thread_local std::vector<std::uint8_t> hidden;
    hidden.clear();
    part.looked_up = {};
    part.others = 0;
    const BlockBox place = part.triangles.empty() ? BlockBox{} : place_of(part);
    if (!place.is_empty && !in_doubt(place)) {
      // Where it would be.
      part.looked_up.Extend(place.low + Index3{-1, -1, -1});
      part.looked_up.Extend(place.high + Index3{1, 1, 1});
    } else if (!place.is_empty) {
      const BlockBox box = FindLookUps(part, voxel, look_ups);
      part.looked_up = {BlockOf(box.low), BlockOf(box.high), false};
      hidden.resize(look_ups.size());
      part.others = hidden_at(look_ups, hidden);
      if (std::find(hidden.begin(), hidden.end(), 1) == hidden.end()) hidden.clear();
    }
    if (part.is_settled && part.hidden == hidden) return;
    part.is_settled = true;
    part.hidden.assign(hidden.begin(), hidden.end());
    part.todo = kNamesChanged;
  });
  std::vector<MeshPart*> changed;
  std::vector<MeshPart*> to_name;
  for (MeshPart* part : parts) {
    if ((part->todo & kNamesChanged) == 0) continue;
    changed.push_back(part);
    for (std::size_t which = 0; which < 8; ++which) {
      MeshPart* named = part->around[UpperPlace(which)];
      if (named == nullptr || (named->todo & kToBeNamed) != 0) continue;
      named->todo |= kToBeNamed;
      to_name.push_back(named);
    }
  }
  for (MeshPart* part : parts) part->todo = 0;
  ForEachPart(to_name, [](MeshPart& part) {
    part.todo = 0;
    RenameVertices(part);
  });
  return changed;
}

}  // namespace tsdfpp
