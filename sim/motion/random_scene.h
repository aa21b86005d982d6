// Scenes drawn from ranges.
#pragma once

#include <cstdint>

#include "core/error.h"
#include "sim/config/random_scene_config.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

// The scene of a seed, the same for the same ranges and seed. In no frame are scripted objects
// nearer to one another than the gap; one that falls touches nothing before it is let go. Every
// object is in view in the stated share of the frames: its middle and half of the corners of its
// bounding box lie in the image (whether another object hides it is not asked). What does not fit
// is drawn anew, first the object, then the whole scene.
// Errors: kUsage where there is no model, motion or camera path to draw from, or where kMaxDraws
// scenes did not fit, naming what could not be placed; those of MakeModel and BakePhysics.
Expected<SceneConfig> DrawRandomScene(const RandomSceneConfig& config, std::uint64_t seed);

inline constexpr int kMaxDraws = 40;

}  // namespace tsdfpp
