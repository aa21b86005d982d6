// What a map of voxels lets be looked at, voxel by voxel: for questions, figures and tests. A map
// may have none (MapRepresentation::inspection).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "mapper/index/listing.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

class MapRepresentation;

// What a map holds about one object (or, for one field, about all) at one voxel.
struct VoxelValue {
  float distance_m = 0;  // signed, positive in front of the surface
  float weight = 0;      // observations, above 0
  Colour colour{};
};

class VoxelInspection {
 public:
  virtual ~VoxelInspection() = default;

  // The object's voxel at an index of its lattice; nothing where it is unobserved. One field: the
  // voxel if it is labelled so.
  virtual std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const = 0;

  // The stored voxels of the object, in its lattice (that of all, for one field); nullptr where the
  // map has none. Valid until the map changes.
  virtual const TsdfGrid* GridOf(InstanceId id) const = 0;

  // The objects listed at a global voxel, the active one first.
  virtual std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const = 0;

  // Every voxel of the lattice frame that is observed for this object, sorted by (z, y, x).
  virtual std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const = 0;

  // Every global voxel with a non-empty list, sorted by (z, y, x).
  virtual std::vector<Eigen::Vector3i> ListedVoxels() const = 0;

  // The first thing found in what is stored that docs/map.md rules out, in a sentence; nothing
  // where all is well. Slow: it looks at every voxel.
  virtual std::optional<std::string> FindFault() const = 0;
};

// The map's, for whoever knows that it has voxels: aborts where it has none.
const VoxelInspection& VoxelsOf(const MapRepresentation& map);

// The map's. Errors: kUsage, a sentence that names the method and `needed_for` ("a slice, say"),
// where it has none.
Expected<const VoxelInspection*> AskForVoxels(const MapRepresentation& map,
                                              std::string_view needed_for);

}  // namespace tsdfpp
