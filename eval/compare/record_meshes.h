// Meshes that a report shows of a comparison besides the maps', and how it cuts those.
#pragma once

#include <Eigen/Geometry>
#include <utility>

#include "core/types.h"
#include "eval/truth/scene_truth.h"

namespace tsdfpp {

// Faces whose first corner lies in `box`, and the others. Without labels.
std::pair<TriangleMesh, TriangleMesh> SplitByBox(const TriangleMesh& mesh,
                                                 const Eigen::AlignedBox3f& box);

// The true table's box with a margin of 15 cm, in metres and the world's frame; empty where the
// scene names none.
Eigen::AlignedBox3f TableBox(const SceneTruth& truth);

// What the table's hole is counted by (hole_area_cm2), in the world's frame, as squares a little
// larger than the samples' shares, for samples are jittered in their cells, and a millimetre in
// front of the true surface. `reconstructed`: of the first surface's samples those that the map
// has.
TriangleMesh HoleMesh(const SceneTruth& truth, const Selection& reconstructed);

}  // namespace tsdfpp
