#include "tests/reference/float_voxel.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp::reference {
namespace {

// voxblox passes over an observation where what it gives a voxel is next to nothing.
constexpr float kLeastWeight = 1e-6F;
constexpr float kMostOfAByte = 255;

}  // namespace

MapConfig FloatConfig::Map() const {
  MapConfig map;
  map.voxel_m = voxel_m;
  map.trunc_front_voxels = front_voxels;
  map.trunc_back_voxels = back_voxels;
  return map;
}

FloatRule::FloatRule(const FloatConfig& config)
    : config_(config),
      map_(config.Map()),
      voxel_(map_.voxel()),
      front_(map_.front()),
      back_(map_.back()) {}

float FloatRule::WeightOf(const Seen& seen, const Intrinsics& camera) const {
  const Weighting& rule = config_.weighting;
  float weight = 1;
  if (rule.inverse_square) weight /= seen.surface_z * seen.surface_z;
  if (rule.rays) {
    const auto pixels =
        static_cast<float>(camera.fx * camera.fy * config_.voxel_m * config_.voxel_m);
    weight *= pixels / (seen.voxel_z * seen.voxel_z);
  }
  if (rule.drop_off && seen.s < -voxel_) {
    weight *= std::max((back_ + seen.s) / (back_ - voxel_), 0.0F);
  }
  return weight;
}

FloatVoxel FloatRule::Stored(float distance, float weight) const {
  if (config_.byte_weights) weight = std::min(std::floor(weight + 0.5F), kMostOfAByte);
  if (weight <= 0) return {};
  return {config_.half_distances ? Kept(distance) : distance, weight};
}

void FloatRule::Fuse(const Seen& seen, float weight, FloatVoxel& voxel) const {
  if (seen.s < -back_) return;
  const float sum = voxel.weight + weight;
  if (sum < kLeastWeight) return;
  const float s = config_.clamp_mean ? seen.s : std::min(seen.s, front_);
  // For a weight of 1 these are the operations of docs/map.md, in their order.
  const float part = weight / sum;
  float distance = voxel.distance + (s - voxel.distance) * part;
  if (config_.clamp_mean) distance = std::clamp(distance, -back_, front_);
  voxel = Stored(distance, std::min(sum, config_.weighting.cap));
}

FloatVoxel FloatRule::Fresh(float distance, float weight) const { return Stored(distance, weight); }

std::optional<FloatVoxel> FloatRule::Interpolate(const Neighbourhood& place,
                                                 const std::array<FloatVoxel, 8>& corners) const {
  std::array<float, 8> distances{};
  std::array<float, 8> weights{};
  for (std::size_t i = 0; i < 8; ++i) {
    if (!corners[i].observed()) return std::nullopt;
    distances[i] = corners[i].distance;
    weights[i] = corners[i].weight;
  }
  return Stored(place.Interpolate(distances), place.Interpolate(weights));
}

}  // namespace tsdfpp::reference
