// What method `surfels` keeps: a list of discs an object, in the object's own frame (docs/map.md,
// "`surfels`"; Keller et al. 2013, section 3).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// The rules' constants; lengths are in voxels.
inline constexpr double kSurfelSpacing_voxels = 0.75;
// Where pixels are coarser: no point of a surface that is seen again is farther from a pixel's.
inline constexpr double kSurfelSpacing_pixels = 0.75;
inline constexpr double kMostSurfelRadius_voxels = 4;
// Along the ray: within it a pixel is of the surfel, and what is farther in front is not there.
inline constexpr double kSurfelSlack_voxels = 1;
// Of the normals of a pixel and its surfel, as in ElasticFusion, section III.
inline constexpr double kMostSurfelTurn_deg = 30;
// Frames that have to see a surfel before it is shown, and within how many after its first one.
inline constexpr int kStableSightings = 2;
inline constexpr std::uint32_t kFramesToBeStable = 10;
// As voxels nearer than this are not in view (docs/map.md, "Observation of a voxel").
inline constexpr double kNearestSeen_m = 0.05;

struct Surfel {
  Eigen::Vector3f centre;  // in the object's lattice frame L, metres
  Eigen::Vector3f normal;  // in L, unit, outwards
  float radius_m = 0;
  std::array<std::uint16_t, 3> colour{};  // red, green, blue in 8.8 fixed point
  std::uint16_t confidence = 0;           // frames that saw it, up to 65535
  std::uint32_t born = 0;                 // the map's frame that first saw it, from 1

  bool is_stable() const { return confidence >= kStableSightings; }
  Colour Rounded() const {
    const auto level = [](std::uint16_t value) {
      return static_cast<std::uint8_t>(std::min((value + 128) >> 8, 255));
    };
    return {level(colour[0]), level(colour[1]), level(colour[2])};
  }
  bool operator==(const Surfel&) const = default;
};

struct SurfelObject {
  std::vector<Surfel> surfels;
  std::optional<Pose> T_WO_birth;  // the first pose that the object was given
  std::optional<Pose> T_WO;        // the last
  Pose T_WL = Pose::Identity();
  bool lattice_is_world = true;  // T_WL is exactly the identity
};

// Ordered, so that every walk over the objects is in increasing id.
using SurfelObjects = std::map<InstanceId, SurfelObject>;

}  // namespace tsdfpp
