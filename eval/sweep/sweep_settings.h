// What may differ from one cell of an experiment to another: scene, seed, method and the settings
// of sensor, motion and map (docs/experiments.md).
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/error.h"
#include "eval/sweep/sabotage.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

// The names, among methods, of Open3D's ScalableTSDFVolume, which maps a static world, begin with
// this; its band follows, in voxels on both sides: "open3d/10".
inline constexpr std::string_view kOpen3dMethod = "open3d/";

// Of experiments, whose values are doubles: each whole number up to it is one. A scene's own seed
// may be larger.
inline constexpr std::uint64_t kLargestSeed = std::uint64_t{1} << 53;

struct CellSettings {
  // What determines the frames.
  std::string scene;  // a scene file, relative to the experiment's folder
  std::uint64_t seed = 1;
  std::string sensor = "scene";  // a preset (sim/config/sensor_config.h), or the scene's own
  double noise = 1;              // times the standard deviations of the depth model
  double mask_faults = 0;        // times the rates of the preset masks_mild
  double camera_error = 0;       // times the sizes of the preset pose_drift
  double object_error = 0;       // times 1 mm and 0.1 degrees on each axis of each given pose
  int speed = 1;                 // every speed-th frame only: all moves that much farther
  int objects = 0;               // the scene's first n objects, by id; 0: all
  int fuse_until = 0;            // later frames carry poses alone; 0: all frames are fused

  // What determines the map.
  std::string method = "tsdf++";
  std::string profile = "close";  // truncation, where the next two do not replace it
  double trunc_front = 0;         // voxels; 0: the profile's
  double trunc_back = 0;          // voxels; 0: the profile's
  double voxel_m = 0.01;
  int layers = 0;  // K; 0: the method's own
  std::string poses = "gt";
  // What finds the objects; "depth" and "full" have ids of their own, associated by votes.
  std::string segmentation = "gt";
  std::string mask_repair = "off";
  std::string resampling = "all";
  // Of one field:
  std::string moved_voxels = "all";
  std::string removed_voxels = "free";
  double vote_band = 100;  // voxels

  // What is broken on purpose, of either or of the scoring (eval/sweep/sabotage.h).
  Sabotage sabotage = Sabotage::kNone;

  // The map's configuration; of Open3D voxel size and, front and back, its own band alone. It
  // lacks the network that segmentation "full" needs. Errors: kUsage.
  Expected<PipelineConfig> Pipeline() const;
  bool is_open3d() const { return method.starts_with(kOpen3dMethod); }
};

using AxisValue = std::variant<std::string, double>;
std::string AxisText(const AxisValue& value);
nlohmann::json AxisJson(const AxisValue& value);

// One thing that an experiment may vary, by its name in TOML and CSV.
struct Axis {
  std::string name;
  // Errors: kUsage, a clause such as "is 3, expected ..." without the axis's name.
  Expected<void> (*set)(CellSettings& settings, const AxisValue& value);
  AxisValue (*get)(const CellSettings& settings);
};

// In the order of CSV columns.
const std::vector<Axis>& Axes();
// nullptr where there is none of this name.
const Axis* FindAxis(std::string_view name);

// Every axis with its value, in the order of Axes().
nlohmann::json SettingsJson(const CellSettings& settings);
// Errors: kData, naming the axis that is missing or wrong.
Expected<CellSettings> SettingsFromJson(const nlohmann::json& json);

// The part of the settings that the map's bytes depend on, as text: what a method does not have is
// not in it, and every default is the number that it stands for. Settings must be valid.
std::string MapKey(const CellSettings& settings);

}  // namespace tsdfpp
