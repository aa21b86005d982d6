// The table of ready-made sensors.
#include <algorithm>

#include "sim/config/sensor_config.h"

namespace tsdfpp {
namespace {

SensorConfig WithModel(DepthModel model) {
  SensorConfig config;
  config.depth.model = model;
  return config;
}

// Simkinect's noise with what its authors leave out: the projector's shadow, and no depth near, far
// and at grazing angles. These limits, and all numbers below, are our choice, not measured ones.
SensorConfig Kinect() {
  SensorConfig config = WithModel(DepthModel::kSimKinect);
  config.depth.shadow_baseline_m = 0.075;
  config.depth.min_range_m = 0.4;
  config.depth.max_range_m = 4;
  config.depth.dropout_incidence_start_deg = 75;
  config.depth.dropout_incidence_end_deg = 85;
  return config;
}

SensorConfig ColourNoise() {
  SensorConfig config;
  config.colour.exposure_jitter_ev = 0.05;
  config.colour.vignetting = 0.7;
  config.colour.full_well_electrons = 5000;
  config.colour.noise_levels = 1.5;
  return config;
}

SensorConfig PoseErrors(int times) {
  SensorConfig config;
  config.camera_pose = {times * 5e-4, times * 2e-2, times * 1e-3, times * 5e-2};
  return config;
}

SensorConfig MaskFaults(int times) {
  const auto share = [times](int percent) { return times * percent / 100.0; };
  SensorConfig config;
  MaskFaultConfig& masks = config.masks;
  masks.missing = {share(5), 3};
  masks.undershoot = {{share(20), 5}, 2};
  masks.bleed = {{share(30), 5}, 3};
  masks.split = {share(2), 3};
  masks.merged = {{share(5), 3}, 3};
  masks.flicker = {share(2), 2};
  masks.wrong_class = {share(5), 5};
  return config;
}

SensorConfig RedrawnIds() {
  SensorConfig config;
  config.masks.flicker = {1, 1};
  return config;
}

Expected<SensorConfig> OnePreset(std::string_view name, std::string_view joined) {
  std::vector<std::string> names;
  for (const SensorPreset& preset : SensorPresets()) {
    if (preset.name == name) return preset.config;
    names.push_back(preset.name);
  }
  if (name.empty()) {
    return UsageError(
        "sensor preset '{}' leaves a name out, expected one name or several joined by "
        "'+', e.g. kinect+masks_mild",
        joined);
  }
  return UsageError(
      "sensor preset '{}' does not exist, expected one of, or several joined by '+': {}", name,
      fmt::join(names, ", "));
}

// A part of the sensor that a preset sets replaces an exact one; false where it is set already.
template <typename Part>
bool Join(const Part& part, Part& joined) {
  if (part == Part{}) return true;
  if (joined != Part{}) return false;
  joined = part;
  return true;
}

}  // namespace

const std::vector<SensorPreset>& SensorPresets() {
  static const std::vector<SensorPreset> kPresets = {
      {"exact", "no fault at all", {}},
      {"nguyen2012", "Kinect v1 depth (Nguyen 2012)", WithModel(DepthModel::kNguyen2012)},
      {"icl_nuim", "Kinect v1 depth as in ICL-NUIM", WithModel(DepthModel::kIclNuim)},
      {"simkinect", "Kinect v1 depth, dot pattern", WithModel(DepthModel::kSimKinect)},
      {"kinect", "simkinect with projector shadow, range and grazing drop-out", Kinect()},
      {"cofusion", "depth of Co-Fusion's synthetic sets", WithModel(DepthModel::kCoFusion)},
      {"redwood", "PrimeSense depth as in Redwood", WithModel(DepthModel::kRedwood)},
      {"azure", "Azure Kinect depth", WithModel(DepthModel::kAzure)},
      {"d435", "RealSense D435 depth", WithModel(DepthModel::kD435)},
      {"colour_noise", "exact depth, colour with noise, vignetting, changing exposure",
       ColourNoise()},
      {"pose_drift", "exact images, camera poses that drift and shake a little", PoseErrors(1)},
      {"pose_drift_strong", "exact images, five times as much", PoseErrors(5)},
      {"masks_mild", "exact images, few mask faults of every kind", MaskFaults(1)},
      {"masks_severe", "exact images, three times as many", MaskFaults(3)},
      {"masks_redrawn", "exact images, each object another id in every frame", RedrawnIds()},
  };
  return kPresets;
}

Expected<SensorConfig> SensorPresetNamed(std::string_view name) {
  SensorConfig joined;
  std::size_t start = 0;
  while (start <= name.size()) {
    const std::size_t end = std::min(name.find('+', start), name.size());
    TSDFPP_ASSIGN(const SensorConfig part, OnePreset(name.substr(start, end - start), name));
    if (!Join(part.depth, joined.depth) || !Join(part.colour, joined.colour) ||
        !Join(part.shutter, joined.shutter) || !Join(part.camera_pose, joined.camera_pose) ||
        !Join(part.masks, joined.masks)) {
      return UsageError("sensor preset '{}' joins two that both set the same part of the sensor",
                        name);
    }
    start = end + 1;
  }
  return joined;
}

}  // namespace tsdfpp
