// Physics, simulated before anything is rendered: the poses of each object at each frame, after
// which the scene is rendered from poses alone.
#pragma once

#include <map>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

// The bodies and how they touch:
// - an object with [object.physics] moves freely from its start frame on and is held until then;
// - every other object, at rest, driven or carried, follows its script and pushes what it meets: a
//   pusher is an object with keyframes;
// - the room is its ground (table or floor), the walls and, below a table, the floor.
// A sphere collides as one, each convex part of another model as its convex hull. A part that is
// not convex (by more than kConvexTolerance_m) is cut into cells, kCellSectors sectors about the
// model's vertical axis and kCellLayers layers, and the hull of each cell collides: a bowl is
// hollow, a garage can be entered. Surfaces keep kToyClearance_m apart, as toys at rest do.
//
// T_WO of the objects that physics moves, for each frame of the scene, the first of frame 1;
// nothing where physics moves none. The same on one machine for the same scene (docs/sources.md,
// "Physics": MuJoCo is reproducible only for one version on one architecture). Errors: those of
// MakeModel; kEnvironment where MuJoCo refuses the model; kUsage where the simulation diverges,
// naming the frame.
Expected<std::map<InstanceId, std::vector<Pose>>> BakePhysics(const SceneConfig& config);

inline constexpr double kConvexTolerance_m = 0.002;
inline constexpr int kCellSectors = 12;
inline constexpr int kCellLayers = 3;

// The points whose hulls are the collision bodies of a model, in its frame; none is flat.
std::vector<std::vector<Eigen::Vector3d>> CollisionHulls(const std::vector<ModelPart>& parts);

}  // namespace tsdfpp
