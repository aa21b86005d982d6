#include "mapper/associate/object_lookup.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tsdfpp {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::infinity();
constexpr float kLeastKnown = 0.5F;  // of the coefficients
// Of the truncation distance in front, which is all that is stored of what is farther; less than it
// by more than a half's rounding.
constexpr float kFree = 0.999F;
// Further out no voxel is, and indices stay far from the ends of their 21 bits.
constexpr double kFurthest = double{kBlockSide} * (kFurthestBlock + 1);

// What a volume says at a point of its lattice.
struct Answer {
  float distance = kUnknown;  // signed, as stored; infinite where too little is known
  float weight = 0;
};

Answer FromObserved(const VoxelReader& reader, const Eigen::Vector3d& q) {
  if (!(q.cwiseAbs().maxCoeff() < kFurthest)) return {};
  const Corners corners = FindCorners(reader, q);
  float known = 0;
  float sum = 0;
  float weights = 0;
  for (std::size_t i = 0; i < corners.block.size(); ++i) {
    const TsdfBlock* block = corners.block[i];
    const auto place = static_cast<std::size_t>(corners.place[i]);
    if (block == nullptr || !(block->weight[place] > 0)) continue;
    float coefficient = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float f = corners.fraction[axis];
      coefficient *= ((i >> axis) & 1U) != 0 ? f : 1 - f;
    }
    known += coefficient;
    sum += coefficient * static_cast<float>(block->distance[place]);
    weights += coefficient * static_cast<float>(block->weight[place]);
  }
  if (!(known >= kLeastKnown)) return {};
  return {sum / known, weights / known};
}

// Around the points whose eight voxels are not all outside of the blocks.
Eigen::AlignedBox3d BoxOf(const VoxelReader& reader, const Pose& T_WL, double voxel_m) {
  Eigen::AlignedBox3d box;
  if (reader.empty()) return box;
  const auto corner = [](const Index3& block) -> Eigen::Vector3d {
    return Eigen::Vector3d(block.x, block.y, block.z) * kBlockSide;
  };
  const Eigen::AlignedBox3d of_blocks(
      corner(reader.low()) - Eigen::Vector3d::Ones(),
      corner(reader.high()) + Eigen::Vector3d::Constant(kBlockSide));
  for (int i = 0; i < 8; ++i) {
    const auto at = static_cast<Eigen::AlignedBox3d::CornerType>(i);
    box.extend(T_WL * (voxel_m * of_blocks.corner(at)));
  }
  return box;
}

// Of voxels, by axis.
using Coordinates = std::array<std::vector<int>, 3>;

// But for a share of ObjectLookup::kStray on each side; reorders them.
Eigen::AlignedBox3d BoxAround(Coordinates& voxels, double voxel_m) {
  if (voxels[0].empty()) return {};
  const auto stray =
      static_cast<std::ptrdiff_t>(ObjectLookup::kStray * static_cast<double>(voxels[0].size()));
  Eigen::Vector3d low;
  Eigen::Vector3d high;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<int>& values = voxels[static_cast<std::size_t>(axis)];
    std::nth_element(values.begin(), values.begin() + stray, values.end());
    low[axis] = voxel_m * values[static_cast<std::size_t>(stray)];
    std::nth_element(values.begin(), values.end() - 1 - stray, values.end());
    high[axis] = voxel_m * *(values.end() - 1 - stray);
  }
  return {low, high};
}

}  // namespace

ObjectLookup::ObjectLookup(const MapRepresentation& map, Of of)
    : voxels_(map.inspection()),
      voxel_m_(map.config().voxel_m),
      front_m_(map.config().front()),
      ids_(map.Objects()),
      one_field_(IsOneField(map.method())) {
  if (of == Of::kObjects) std::erase(ids_, kBackground);
  std::erase_if(
      ids_, [&](InstanceId id) { return voxels_ == nullptr || voxels_->GridOf(id) == nullptr; });
  const auto add_place = [&](InstanceId id, const Pose& T_WL) {
    VoxelReader reader(*voxels_->GridOf(id));
    const Eigen::AlignedBox3d box_W = BoxOf(reader, T_WL, voxel_m_);
    places_.push_back({std::move(reader), T_WL.inverse(), box_W});
  };
  if (one_field_ && !ids_.empty()) {
    add_place(ids_.front(), Pose::Identity());
    return;
  }
  for (const InstanceId id : ids_) add_place(id, map.ObjectLattice(id));
}

std::optional<std::size_t> ObjectLookup::NumberOf(InstanceId id) const {
  const auto found = std::lower_bound(ids_.begin(), ids_.end(), id);
  if (found == ids_.end() || *found != id) return std::nullopt;
  return static_cast<std::size_t>(found - ids_.begin());
}

std::vector<std::size_t> ObjectLookup::Around(const std::vector<Eigen::Vector3d>& points_W) const {
  Eigen::AlignedBox3d box_W;
  for (const Eigen::Vector3d& p_W : points_W) box_W.extend(p_W);
  // A voxel more, for rounding.
  const Eigen::Vector3d rim = Eigen::Vector3d::Constant(voxel_m_);
  const Eigen::AlignedBox3d wide_W(box_W.min() - rim, box_W.max() + rim);
  std::vector<std::size_t> objects;
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    if (one_field_ || wide_W.intersects(places_[i].box_W)) objects.push_back(i);
  }
  return objects;
}

void ObjectLookup::VisitSurface(InstanceId of,
                                const std::function<void(const Index3& voxel)>& visit) const {
  for (const TsdfGrid::Entry* entry : voxels_->GridOf(of)->Sorted()) {
    const TsdfBlock& block = *entry->block;
    if (!block.AnyNegative()) continue;
    for (int i = 0; i < kBlockVoxels; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (!(block.weight[at] > 0) ||
          std::abs(float{block.distance[at]}) > static_cast<float>(voxel_m_)) {
        continue;
      }
      visit(VoxelAt(entry->index, i));
    }
  }
}

std::vector<ObjectLookup::SurfaceBox> ObjectLookup::BoxesOfSurfaces(
    std::span<const std::size_t> objects) const {
  std::vector<Coordinates> of(objects.size());
  const auto add = [&](std::size_t i, const Index3& voxel) {
    of[i][0].push_back(voxel.x);
    of[i][1].push_back(voxel.y);
    of[i][2].push_back(voxel.z);
  };
  if (one_field_ && !objects.empty()) {
    VisitSurface(ids_.front(), [&](const Index3& voxel) {
      const std::vector<Listing> list = voxels_->ListAt({voxel.x, voxel.y, voxel.z});
      const auto number = list.empty() ? std::nullopt : NumberOf(list.front().id);
      if (!number) return;
      const auto place = std::lower_bound(objects.begin(), objects.end(), *number);
      if (place != objects.end() && *place == *number) {
        add(static_cast<std::size_t>(place - objects.begin()), voxel);
      }
    });
  } else {
    tbb::parallel_for(std::size_t{0}, objects.size(), [&](std::size_t i) {
      VisitSurface(ids_[objects[i]], [&](const Index3& voxel) { add(i, voxel); });
    });
  }
  std::vector<SurfaceBox> boxes;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const Place& place = one_field_ ? places_.front() : places_[objects[i]];
    boxes.push_back({place.T_LW, BoxAround(of[i], voxel_m_)});
  }
  return boxes;
}

bool ObjectLookup::HasSurfaceAround(std::size_t object, const Eigen::Vector3d& p_W) const {
  const Place& place = one_field_ ? places_.front() : places_[object];
  const Eigen::Vector3d q = place.T_LW * p_W / voxel_m_;
  if (place.reader.empty() || !(q.cwiseAbs().maxCoeff() < kFurthest)) return false;
  const Index3 middle = BlockOf(FloorOf(q));
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        const TsdfBlock* block = place.reader.BlockAt(middle + Index3{x, y, z});
        if (block != nullptr && block->AnyNegative()) return true;
      }
    }
  }
  return false;
}

void ObjectLookup::Distances(const Eigen::Vector3d& p_W, std::span<const std::size_t> objects,
                             std::vector<Distance>& distances) const {
  distances.clear();
  if (objects.empty()) return;
  const auto at = [&](const Place& place) {
    const Eigen::Vector3d q = place.T_LW * p_W / voxel_m_;
    Answer answer = FromObserved(place.reader, q);
    // Free space, however far from the surface.
    if (answer.distance >= kFree * front_m_) return Answer{};
    answer.distance = std::abs(answer.distance) / static_cast<float>(voxel_m_);
    return answer;
  };
  if (!one_field_) {
    for (const std::size_t i : objects) {
      const Answer answer = at(places_[i]);
      if (answer.distance != kUnknown) distances.push_back({i, answer.distance, answer.weight});
    }
    return;
  }
  const Answer answer = at(places_.front());
  if (answer.distance == kUnknown) return;
  const Index3 nearest = FloorOf(p_W / voxel_m_ + Eigen::Vector3d::Constant(0.5));
  const std::vector<Listing> list = voxels_->ListAt({nearest.x, nearest.y, nearest.z});
  if (list.empty()) return;
  const std::optional<std::size_t> i = NumberOf(list.front().id);
  if (i && std::binary_search(objects.begin(), objects.end(), *i)) {
    distances.push_back({*i, answer.distance, answer.weight});
  }
}

}  // namespace tsdfpp
