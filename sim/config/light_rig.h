// The lamps of a scene: fixed, or drawn from ranges.
#pragma once

#include <mujoco/mujoco.h>
#include <toml++/toml.h>

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// MuJoCo's renderer draws no light from the third kind that its models know, the point.
enum class LightKind { kSpot, kDirectional };

struct SceneLight {
  LightKind kind = LightKind::kSpot;
  Eigen::Vector3d position_W{-1.3, 0.5, 2.4};  // metres; of a directional one, gives its direction
  Eigen::Vector3d target_W{0.1, 0.0, 0.6};     // what it shines at
  Eigen::Vector3d colour{0.85, 0.85, 0.85};    // red, green, blue strength, 0 to 1
  double gloss = 0.4;                          // strength of its highlights, 0 to 1
  double cutoff_deg = 55;                      // of a spot: half its cone
  double exponent = 4;                         // of a spot: how fast it fades from the middle
  bool shadow = true;
};

// Light from everywhere (which moves with nothing) and the lamps.
struct LightRig {
  double ambient = 0.34;
  std::vector<SceneLight> lights;

  // Errors: kUsage, with the field: more than kMaxLights, a value out of range or not finite, a
  // position at its target.
  Expected<void> Validate() const;
  toml::table ToToml() const;
};

// OpenGL's fixed pipeline has eight, one of which is MuJoCo's head light (the ambient).
inline constexpr std::size_t kMaxLights = 7;

// A lamp below the ceiling that casts shadows, and a soft fill from the other side.
LightRig DefaultLightRig();

// Reads {ambient, [[light]]: kind, position, target, colour, gloss, cutoff_deg, exponent, shadow};
// without any light the default ones remain. Errors: kUsage, with file and key.
Expected<LightRig> ReadLightRig(const toml::table& table, const std::string& where,
                                const std::string& path);

// Ranges, each low to high, that a random scene draws its lamps from.
struct LightRanges {
  int least_lights = 1;
  int most_lights = 3;
  Eigen::Vector2d ambient{0.22, 0.38};
  Eigen::Vector2d strength{0.4, 0.75};   // of the first lamp; the others share as much again
  double tint = 0.12;                    // how far the colour channels may differ
  Eigen::Vector2d distance_m{1.0, 1.6};  // of lamps from the target, horizontally
  Eigen::Vector2d height_m{1.2, 1.7};    // above the target
  double shadow_share = 0.8;             // how often the first lamp casts shadows; the others never
  Eigen::Vector3d target_W{0, 0, 0.75};

  // Errors: kUsage, with the field.
  Expected<void> Validate() const;
};

// The rig of (seed): the same on every machine. The first lamp is a spot, the others are
// directional or points. `ranges` must be valid.
LightRig DrawLightRig(const LightRanges& ranges, std::uint64_t seed);

// Puts the lamps into a spec and sets its ambient light.
void AddLights(mjSpec* spec, const LightRig& rig);

}  // namespace tsdfpp
