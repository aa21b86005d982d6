#include "sim/config/light_rig.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/random.h"
#include "core/toml_reader.h"

namespace tsdfpp {
namespace {

constexpr std::uint32_t kRigStream = 111;   // how many lamps, the ambient light
constexpr std::uint32_t kLampStream = 112;  // and the one after it, one draw a lamp

constexpr std::array<const char*, 2> kKindNames{"spot", "directional"};  // by LightKind

const char* NameOf(LightKind kind) { return kKindNames[static_cast<std::size_t>(kind)]; }

bool IsShare(double value) { return value >= 0 && value <= 1; }

toml::array ToArray(const Eigen::Vector3d& v) { return toml::array{v.x(), v.y(), v.z()}; }

Expected<void> CheckLight(const SceneLight& light, std::size_t index) {
  const auto fault = [&](const char* field, const std::string& rest) {
    return UsageError("light[{}].{} {}", index, field, rest);
  };
  if (!light.position_W.allFinite()) return fault("position", "is not finite");
  if (!light.target_W.allFinite()) return fault("target", "is not finite");
  if (light.position_W == light.target_W) {
    return fault("target", "is the light's own position, so it has no direction");
  }
  for (const double channel : light.colour) {
    if (!IsShare(channel)) return fault("colour", fmt::format("has {}, expected 0 to 1", channel));
  }
  if (!IsShare(light.gloss))
    return fault("gloss", fmt::format("is {}, expected 0 to 1", light.gloss));
  if (!(light.cutoff_deg >= 1 && light.cutoff_deg <= 90)) {
    return fault("cutoff_deg", fmt::format("is {}, expected 1 to 90", light.cutoff_deg));
  }
  if (!(light.exponent >= 0 && light.exponent <= 128)) {
    return fault("exponent", fmt::format("is {}, expected 0 to 128", light.exponent));
  }
  return {};
}

SceneLight ReadLight(TomlReader& reader) {
  SceneLight light;
  std::string kind = NameOf(light.kind);
  reader.Get("kind", kind);
  const auto* known = std::find(kKindNames.begin(), kKindNames.end(), kind);
  if (known == kKindNames.end()) {
    reader.Fault("kind", fmt::format("is '{}', expected spot or directional", kind));
  } else {
    light.kind = static_cast<LightKind>(known - kKindNames.begin());
  }
  reader.Get("position", light.position_W, true)
      .Get("target", light.target_W)
      .Get("colour", light.colour)
      .Get("gloss", light.gloss)
      .Get("cutoff_deg", light.cutoff_deg)
      .Get("exponent", light.exponent)
      .Get("shadow", light.shadow);
  return light;
}

}  // namespace

Expected<void> LightRig::Validate() const {
  if (!IsShare(ambient)) return UsageError("ambient is {}, expected 0 to 1", ambient);
  if (lights.size() > kMaxLights) {
    return UsageError("light is there {} times, expected {} at most (OpenGL has no more)",
                      lights.size(), kMaxLights);
  }
  for (std::size_t i = 0; i < lights.size(); ++i) {
    TSDFPP_RETURN_IF_ERROR(CheckLight(lights[i], i));
  }
  return {};
}

toml::table LightRig::ToToml() const {
  toml::array all;
  for (const SceneLight& light : lights) {
    all.push_back(toml::table{{"kind", NameOf(light.kind)},
                              {"position", ToArray(light.position_W)},
                              {"target", ToArray(light.target_W)},
                              {"colour", ToArray(light.colour)},
                              {"gloss", light.gloss},
                              {"cutoff_deg", light.cutoff_deg},
                              {"exponent", light.exponent},
                              {"shadow", light.shadow}});
  }
  return toml::table{{"ambient", ambient}, {"light", all}};
}

LightRig DefaultLightRig() {
  LightRig rig;
  rig.lights.emplace_back();
  SceneLight fill;
  fill.kind = LightKind::kDirectional;
  fill.position_W = {2.0, -2.5, 2.4};
  fill.target_W = {0, 0, 0.9};
  fill.colour = {0.42, 0.42, 0.42};
  fill.gloss = 0;
  fill.shadow = false;
  rig.lights.push_back(fill);
  return rig;
}

Expected<LightRig> ReadLightRig(const toml::table& table, const std::string& where,
                                const std::string& path) {
  TomlReader reader(table, where, path);
  LightRig rig = DefaultLightRig();
  reader.Get("ambient", rig.ambient);
  const std::vector<const toml::table*> lights = reader.Tables("light");
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (!lights.empty()) rig.lights.clear();
  for (std::size_t i = 0; i < lights.size(); ++i) {
    TomlReader one(*lights[i], where, fmt::format("{}[{}]", reader.PathOf("light"), i));
    rig.lights.push_back(ReadLight(one));
    TSDFPP_RETURN_IF_ERROR(one.Finish());
  }
  if (auto valid = rig.Validate(); !valid) {
    return UsageError("{}: {}{}{}", where, path, path.empty() ? "" : ".", valid.error().message);
  }
  return rig;
}

Expected<void> LightRanges::Validate() const {
  const auto in_order = [](const Eigen::Vector2d& range, double low, double high) {
    return range.allFinite() && range[0] >= low && range[1] <= high && range[0] <= range[1];
  };
  if (least_lights < 1 || least_lights > most_lights ||
      most_lights > static_cast<int>(kMaxLights)) {
    return UsageError("lights are {} to {}, expected a range within 1 to {}", least_lights,
                      most_lights, kMaxLights);
  }
  if (!in_order(ambient, 0, 1)) {
    return UsageError("ambient is {} to {}, expected a range within 0 to 1", ambient[0],
                      ambient[1]);
  }
  if (!in_order(strength, 0, 1)) {
    return UsageError("strength is {} to {}, expected a range within 0 to 1", strength[0],
                      strength[1]);
  }
  if (!IsShare(tint)) return UsageError("tint is {}, expected 0 to 1", tint);
  if (!IsShare(shadow_share))
    return UsageError("shadow_share is {}, expected 0 to 1", shadow_share);
  constexpr double kMost_m = 100;
  if (!in_order(distance_m, 0, kMost_m)) {
    return UsageError("distance_m is {} to {}, expected a range within 0 to {}", distance_m[0],
                      distance_m[1], kMost_m);
  }
  if (!in_order(height_m, 0.1, kMost_m)) {
    return UsageError("height_m is {} to {}, expected a range within 0.1 to {}", height_m[0],
                      height_m[1], kMost_m);
  }
  if (!target_W.allFinite()) return UsageError("target is not finite");
  return {};
}

LightRig DrawLightRig(const LightRanges& ranges, std::uint64_t seed) {
  const auto within = [](const Eigen::Vector2d& range, double share) {
    return range[0] + (range[1] - range[0]) * share;
  };
  const auto choice = UniformDraw(seed, kRigStream, 0);
  LightRig rig;
  rig.ambient = within(ranges.ambient, choice[0]);
  const int count = ranges.least_lights +
                    static_cast<int>(choice[1] * (ranges.most_lights - ranges.least_lights + 1));
  for (int i = 0; i < count; ++i) {
    const auto place = UniformDraw(seed, kLampStream, static_cast<std::uint64_t>(i));
    const auto look = UniformDraw(seed, kLampStream + 1, static_cast<std::uint64_t>(i));
    SceneLight light;
    const double azimuth = 2 * std::numbers::pi * place[0];
    const double distance = within(ranges.distance_m, place[1]);
    light.target_W = ranges.target_W;
    light.position_W = ranges.target_W + Eigen::Vector3d(distance * std::cos(azimuth),
                                                         distance * std::sin(azimuth),
                                                         within(ranges.height_m, place[2]));
    light.kind = i > 0 && place[3] < 0.5 ? LightKind::kDirectional : LightKind::kSpot;
    if (i > 0) {
      light.cutoff_deg = 90;
      light.exponent = 0;
    }
    light.shadow = i == 0 && choice[2] < ranges.shadow_share;
    light.gloss = i == 0 ? 0.4 : 0;
    // The others share what the first one has, or a scene with many would be white all over.
    const double strength =
        within(ranges.strength, look[0]) / (i == 0 ? 1 : count - 1) * (i == 0 ? 1 : 0.6);
    for (int k = 0; k < 3; ++k) {
      light.colour[k] = std::min(1.0, strength * (1 - ranges.tint * look[k + 1]));
    }
    rig.lights.push_back(light);
  }
  return rig;
}

void AddLights(mjSpec* spec, const LightRig& rig) {
  // The head light's ambient part only: the rest would move with the camera and with it the
  // colours.
  spec->visual.headlight.active = 1;
  std::fill_n(spec->visual.headlight.ambient, 3, static_cast<float>(rig.ambient));
  std::fill_n(spec->visual.headlight.diffuse, 3, 0.0F);
  std::fill_n(spec->visual.headlight.specular, 3, 0.0F);
  mjsBody* world = mjs_findBody(spec, "world");
  for (const SceneLight& from : rig.lights) {
    mjsLight* light = mjs_addLight(world, nullptr);
    const Eigen::Vector3d direction = (from.target_W - from.position_W).normalized();
    std::copy_n(from.position_W.data(), 3, light->pos);
    std::copy_n(direction.data(), 3, light->dir);
    light->type = from.kind == LightKind::kSpot ? mjLIGHT_SPOT : mjLIGHT_DIRECTIONAL;
    light->cutoff = static_cast<float>(from.cutoff_deg);
    light->exponent = static_cast<float>(from.exponent);
    light->castshadow = static_cast<mjtBool>(from.shadow);
    std::fill_n(light->ambient, 3, 0.0F);
    for (int k = 0; k < 3; ++k) light->diffuse[k] = static_cast<float>(from.colour[k]);
    std::fill_n(light->specular, 3, static_cast<float>(from.gloss));
  }
}

}  // namespace tsdfpp
