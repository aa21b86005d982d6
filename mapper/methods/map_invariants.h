// What docs/map.md promises of every map at any time ("What always holds"), checked slowly and
// independently of the code that keeps it up.
#pragma once

#include "mapper/index/grid_invariants.h"
#include "mapper/methods/voxel_map.h"

namespace tsdfpp {

// Aborts with the sentence of VoxelInspection::FindFault(), where there is one, in builds without
// NDEBUG and for maps of up to 1000 blocks; does nothing otherwise. Called after every event.
void CheckInDebugBuilds(const VoxelMap& map);

// Parts of FindFault() that any method has; each returns a sentence, or nothing where all is well.
// What is promised of blocks is checked in mapper/index/grid_invariants.h, of an index by itself.

// Lists as the interface gives them: not empty, no longer than K, no object twice, confidences in
// range, every object in the map.
Fault FindListFault(const VoxelMap& map);

// Blocks as Memory() counts them.
Fault FindCountFault(const VoxelMap& map, std::size_t blocks);

// Every object that is listed covers the voxel, in its own lattice; where `by_distance`, lists are
// ordered so.
Fault FindCoverFault(const VoxelMap& map, bool by_distance);

}  // namespace tsdfpp
