// What docs/map.md promises of every map at any time ("What always holds"), checked slowly and
// independently of the code that keeps it up.
#pragma once

#include <optional>
#include <string>

#include "mapper/methods/voxel_map.h"

namespace tsdfpp {

// Aborts with the sentence of VoxelInspection::FindFault(), where there is one, in builds without
// NDEBUG and for maps of up to 1000 blocks; does nothing otherwise. Called after every event.
void CheckInDebugBuilds(const VoxelMap& map);

// The parts of FindFault(); each returns a sentence, or nothing where all is well.
using Fault = std::optional<std::string>;

// Blocks: found where they are, none empty, values in range, masks those of the values; `crossed`
// and `cover` too where `with_cover`. `name` begins the sentence.
Fault FindGridFault(const std::string& name, const TsdfGrid& grid, const MapConfig& config,
                    bool with_cover);

// Lists as the interface gives them: not empty, no longer than K, no object twice, confidences in
// range, every object in the map.
Fault FindListFault(const VoxelMap& map);

// Blocks as Memory() counts them.
Fault FindCountFault(const VoxelMap& map, std::size_t blocks);

// docs/map.md, "Cover": whether a volume covers the point q, in voxels of its lattice.
bool CoversPoint(const TsdfGrid& grid, const Eigen::Vector3d& q, float back);

// The trilinear distance at q, in voxels of the lattice; nothing where a corner that counts is
// unobserved. Metres.
std::optional<float> DistanceAtPoint(const TsdfGrid& grid, const Eigen::Vector3d& q);

}  // namespace tsdfpp
