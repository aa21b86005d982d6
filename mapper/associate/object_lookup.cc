#include "mapper/associate/object_lookup.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tsdfpp {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::infinity();
constexpr float kLeastKnown = 0.5F;  // of the coefficients
// Further out no voxel is, and indices stay far from the ends of their 21 bits.
constexpr double kFurthest = double{kBlockSide} * (kFurthestBlock + 1);

// The distance at a point of the lattice, in the unit of the stored ones; infinity where too little
// is observed.
float DistanceFromObserved(const VoxelReader& reader, const Eigen::Vector3d& q) {
  if (!(q.cwiseAbs().maxCoeff() < kFurthest)) return kUnknown;
  const Corners corners = FindCorners(reader, q);
  float known = 0;
  float sum = 0;
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
  }
  return known >= kLeastKnown ? std::abs(sum / known) : kUnknown;
}

}  // namespace

ObjectLookup::ObjectLookup(const MapRepresentation& map)
    : voxels_(map.inspection()),
      voxel_m_(map.config().voxel_m),
      ids_(map.Objects()),
      one_field_(IsOneField(map.method())) {
  std::erase(ids_, kBackground);
  std::erase_if(
      ids_, [&](InstanceId id) { return voxels_ == nullptr || voxels_->GridOf(id) == nullptr; });
  if (one_field_ && !ids_.empty()) {
    places_.push_back({VoxelReader(*voxels_->GridOf(ids_.front())), Pose::Identity()});
    return;
  }
  for (const InstanceId id : ids_) {
    places_.push_back({VoxelReader(*voxels_->GridOf(id)), map.ObjectLattice(id).inverse()});
  }
}

void ObjectLookup::Distances(const Eigen::Vector3d& p_W, std::vector<float>& distances) const {
  distances.assign(ids_.size(), kUnknown);
  if (ids_.empty()) return;
  const auto at = [&](const Place& place) {
    const Eigen::Vector3d q = place.T_LW * p_W / voxel_m_;
    return DistanceFromObserved(place.reader, q) / static_cast<float>(voxel_m_);
  };
  if (!one_field_) {
    for (std::size_t i = 0; i < ids_.size(); ++i) distances[i] = at(places_[i]);
    return;
  }
  const float distance = at(places_.front());
  if (distance == kUnknown) return;
  const Index3 nearest = FloorOf(p_W / voxel_m_ + Eigen::Vector3d::Constant(0.5));
  const std::vector<Listing> list = voxels_->ListAt({nearest.x, nearest.y, nearest.z});
  if (list.empty()) return;
  const auto of = std::lower_bound(ids_.begin(), ids_.end(), list.front().id);
  if (of == ids_.end() || *of != list.front().id) return;
  distances[static_cast<std::size_t>(of - ids_.begin())] = distance;
}

}  // namespace tsdfpp
