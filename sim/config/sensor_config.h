// What the simulated sensor does to a true frame: depth, colour, shutter, camera pose, masks.
// docs/sensors.md has the formulae. Every default is the exact sensor, which changes no byte.
#pragma once

#include <toml++/toml.h>

#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// Published models of depth cameras (docs/sources.md, "Depth noise").
enum class DepthModel {
  kExact,
  kNguyen2012,  // Kinect v1: axial and lateral noise by distance and angle of incidence
  kIclNuim,     // Kinect v1: bilinear shift and disparity noise in eighths of a pixel
  kSimKinect,   // Kinect v1: matching of a dot pattern in 9x9 windows, then as kIclNuim
  kCoFusion,    // the noise of Co-Fusion's synthetic sets
  kRedwood,     // PrimeSense: subsampled and quantised disparity, without the lens distortion
  kAzure,       // Azure Kinect: time of flight; needs colour, dark surfaces give no depth
  kD435,        // RealSense D435: stereo noise that grows with the square of the distance
};

// Applied in this order: projector shadow, flying pixels, the model, drop-out, range, quantisation.
struct DepthSensorConfig {
  // Distance of a pattern projector from the camera along +x, metres; what it cannot reach gives no
  // depth. 0: no projector.
  double shadow_baseline_m = 0;
  // Share of the pixels at a depth edge that get a depth between both sides.
  double flying_pixel_rate = 0;
  // A jump of depth between neighbours above this is an edge.
  double flying_pixel_step_m = 0.03;
  DepthModel model = DepthModel::kExact;
  // Multiplies the standard deviations of the model; its quantisation remains.
  double noise_scale = 1;
  // No depth with a probability that rises from 0 at the start to 1 at the end, by the angle
  // between viewing ray and surface normal, and by depth. The end at or below the start: at once.
  double dropout_incidence_start_deg = 90;
  double dropout_incidence_end_deg = 90;
  double dropout_range_start_m = 100;
  double dropout_range_end_m = 100;
  // Measured depth outside is 0.
  double min_range_m = 0;
  double max_range_m = 100;
  // Measured depth is rounded to a multiple of this; 0: not rounded.
  double unit_m = 0;
  bool operator==(const DepthSensorConfig&) const = default;
};

// Applied in this order: exposure, vignetting, shot noise (all in linear light), level noise.
struct ColourSensorConfig {
  double exposure_ev = 0;         // stops; +1 doubles the light
  double exposure_jitter_ev = 0;  // standard deviation from frame to frame, stops
  // 0 none, 1 the full cosine-to-the-fourth law of the camera's angle of view.
  double vignetting = 0;
  // Electrons at full scale: the variance of a signal of n electrons is n. 0: no shot noise.
  double full_well_electrons = 0;
  double noise_levels = 0;  // standard deviation in 8-bit levels, after gamma
  bool operator==(const ColourSensorConfig&) const = default;
};

// Needs several renders a frame (sim/render/shutter.h). The frame's time stamp is the middle of the
// middle row's exposure.
struct ShutterConfig {
  double exposure_s = 0;  // a row gathers light this long: motion blur
  double readout_s = 0;   // from the first row's exposure to the last one's: rolling shutter
  int sub_frames = 1;     // renders a frame
  bool operator==(const ShutterConfig&) const = default;
};

// Errors of the given camera pose. All sizes are standard deviations of one axis.
struct CameraPoseConfig {
  double drift_m = 0;    // of the random walk's step from a frame to the next
  double drift_deg = 0;  // about the camera's centre
  double jitter_m = 0;   // of each frame alone
  double jitter_deg = 0;
  bool operator==(const CameraPoseConfig&) const = default;
};

// How often an object has a fault: `rate` is the share of its frames, and a fault lasts `frames`
// frames (longer where a second one begins meanwhile).
struct FaultTiming {
  double rate = 0;
  int frames = 1;
  bool operator==(const FaultTiming&) const = default;
};

struct PixelFault {
  FaultTiming timing;
  int pixels = 2;
  bool operator==(const PixelFault&) const = default;
};

// Applied in this order.
struct MaskFaultConfig {
  FaultTiming missing;      // the object is not found
  PixelFault undershoot;    // its mask ends `pixels` before its edge
  PixelFault bleed;         // its mask reaches `pixels` beyond its edge
  FaultTiming split;        // a line through its middle gives two instances
  PixelFault merged;        // joined with an object whose mask is within `pixels`
  FaultTiming flicker;      // it has another id
  FaultTiming wrong_class;  // it has another object's class
  bool operator==(const MaskFaultConfig&) const = default;
};

struct SensorConfig {
  DepthSensorConfig depth;
  ColourSensorConfig colour;
  ShutterConfig shutter;
  CameraPoseConfig camera_pose;
  MaskFaultConfig masks;
  bool operator==(const SensorConfig&) const = default;
};

// Names of depth models as written in TOML, e.g. "nguyen2012".
const std::vector<std::string>& DepthModelNames();
std::string_view DepthModelName(DepthModel model);

// Ready-made sensors for --sensor NAME and `preset = "NAME"`.
struct SensorPreset {
  std::string name;
  std::string summary;  // one line, for --help
  SensorConfig config;
};
const std::vector<SensorPreset>& SensorPresets();
// The preset of this name, or several that set different parts of the sensor joined by '+', e.g.
// "kinect+masks_mild". Errors: kUsage where one does not exist (lists all), or two set one part.
Expected<SensorConfig> SensorPresetNamed(std::string_view name);

// Error: kUsage, naming the key ("sensor.depth.unit_m") and what it expects.
Expected<void> ValidateSensorConfig(const SensorConfig& config);

// All sub-frames of a frame are in memory at a time. Errors: kUsage where they have more pixels
// than that allows.
Expected<void> CheckSamples(const SensorConfig& sensor, const Intrinsics& camera,
                            const std::string& where);

// Reads the table [sensor] of a scene. `preset` is the start, by default "exact", the other keys
// replace its values. `where` is the file's name, `path` the table's dotted path, for messages.
// Errors: kUsage, with file and line, for an unknown key, a wrong type or a value out of range.
Expected<SensorConfig> ReadSensorConfig(const toml::table& table, const std::string& where,
                                        const std::string& path = "sensor");

// All keys as a TOML table [sensor], which ReadSensorConfig reads back to an equal config.
std::string SensorConfigToToml(const SensorConfig& config);

// One line for people, e.g. "depth.model = \"simkinect\", masks.bleed.rate = 0.2": every value that
// differs from the exact sensor's, or "exact".
std::string DescribeSensor(const SensorConfig& config);

}  // namespace tsdfpp
