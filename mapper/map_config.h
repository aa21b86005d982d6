// The settings of a map, shared by all methods. docs/map.md defines each rule they steer.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/half.h"
#include "core/toml_reader.h"
#include "mapper/method_info.h"

namespace tsdfpp {

// Observations farther from the surface colour nothing, or only what has no colour yet: no mesh
// reads it there (docs/map.md).
inline constexpr double kColourBand_voxels = 2;
inline constexpr double kFirstColourBand_voxels = 3;

// What a fused distance is (docs/map.md, "Distances from the surface").
enum class Distances {
  kRay,      // along the pixel's ray, as the paper has it
  kSurface,  // of objects, where a pixel shows a plane: from that plane
};

// Which neighbours of its source point a moved voxel needs (docs/map.md, "Resampling").
enum class Resampling {
  kAll,       // all eight observed
  kObserved,  // the nearest one; the mean is taken over those that are observed
  kNearest,   // the nearest one, whose values are taken as they are
};

// Which voxels of one field a move takes along, and a removal clears (docs/map.md, "`tsdf`").
enum class MovedVoxels {
  kAll,          // all that are labelled so
  kNearSurface,  // of these, those at most a voxel in front of the surface, or behind it
};

// What the voxels of an object that is removed from one field become.
enum class RemovedVoxels {
  kFree,        // free space, seen once
  kUnobserved,  // unknown
};

// "ray", "surface".
std::string_view DistancesName(Distances distances);
// Errors: kUsage.
Expected<Distances> DistancesFromName(std::string_view name);

// "free", "unobserved".
std::string_view RemovedVoxelsName(RemovedVoxels removed);
// Errors: kUsage.
Expected<RemovedVoxels> RemovedVoxelsFromName(std::string_view name);

// "all", "near_surface".
std::string_view MovedVoxelsName(MovedVoxels moved);
// Errors: kUsage.
Expected<MovedVoxels> MovedVoxelsFromName(std::string_view name);

// "all", "observed", "nearest".
std::string_view ResamplingName(Resampling resampling);
// Errors: kUsage.
Expected<Resampling> ResamplingFromName(std::string_view name);

inline constexpr double kSmallestVoxel_m = 0.0005;

inline constexpr double kLargestVoxel_m = 1;

inline constexpr int kMostConfidence = 255;

struct MapConfig {
  double voxel_m = 0.01;
  double trunc_front_voxels = 10;  // F / h
  double trunc_back_voxels = 3;    // B / h
  int layers = 0;                  // K; 0 is the method's own default (LayersOf)
  int weight_cap = 50;             // observations after which a voxel forgets (docs/map.md)
  int confidence_cap = 10;         // votes at which a listing saturates, at most 255
  int moved_confidence = 1;        // of an object in a voxel that it was moved to; up to the cap
  bool contradiction = true;  // tsdf++ and anchored: pixels of others clear what o wrongly claims
  bool rims = true;           // object volumes: cubes at a mask's outline are completed
  bool relist_on_removal = false;  // tsdf++: a removal lists again what overflow had dropped
  bool colour_whole_band = false;  // colour far from the surface too, as one field always does
  Distances distances = Distances::kRay;
  Resampling resampling = Resampling::kAll;  // of the methods that move values
  // Of the methods with one field:
  MovedVoxels moved_voxels = MovedVoxels::kAll;
  RemovedVoxels removed_voxels = RemovedVoxels::kFree;
  double vote_band_voxels = 100;  // |s| / h up to which an observation in band votes

  float voxel() const { return static_cast<float>(voxel_m); }
  // As distances are kept.
  float front() const { return RoundToHalf(static_cast<float>(trunc_front_voxels * voxel_m)); }
  float back() const { return RoundToHalf(static_cast<float>(trunc_back_voxels * voxel_m)); }

  // Whether an observed voxel of a map may hold these values, the distance in metres.
  bool Stores(float distance, double weight, int colours) const {
    return distance >= -back() && distance <= front() && weight >= 1 && weight <= weight_cap &&
           colours <= weight_cap;
  }

  float vote_band() const { return static_cast<float>(vote_band_voxels * voxel_m); }
  // Metres; infinite where the whole band is coloured.
  float colour_band() const { return ColourBandOf(kColourBand_voxels); }
  float first_colour_band() const { return ColourBandOf(kFirstColourBand_voxels); }

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Sets "paper" (10 in front, 10 behind) or "close" (10, 3). Errors: kUsage.
  Expected<void> SetProfile(std::string_view profile);
  // `where` names the file in errors.
  static Expected<MapConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const MapConfig&) const = default;

 private:
  float ColourBandOf(double voxels) const {
    return colour_whole_band ? std::numeric_limits<float>::infinity()
                             : static_cast<float>(voxels * voxel_m);
  }
};

// K for this method: 2 for tsdf++ and literal (the paper's), 4 for anchored, 1 for one field;
// kMaxLayers for volumes, which keeps no lists.
int LayersOf(Method method, const MapConfig& config);

}  // namespace tsdfpp
