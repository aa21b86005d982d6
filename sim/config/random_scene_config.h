// The ranges that random scenes are drawn from: number, shapes, sizes, textures, lights, paths,
// camera.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "sim/config/light_rig.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

// How an object of a random scene moves.
enum class RandomMotion {
  kRest,
  kDrive,  // along a curve on the table
  kCarry,  // lifted, turned and put down elsewhere
  kDrop,   // let fall from above, by physics
};

// Ranges are (low, high); each draw is uniform in its range.
struct RandomSceneConfig {
  std::string name;
  std::string purpose;
  int frames = 0;
  double rate_hz = 30;
  std::uint64_t seed = 1;  // where the caller gives none
  Intrinsics intrinsics;
  SensorConfig sensor;

  Eigen::Vector2d objects{3, 8};
  std::vector<std::string> models;    // of ModelCatalogue(), each as likely as it is listed
  std::vector<RandomMotion> motions;  // each as likely as it is listed
  Eigen::Vector2d scale{0.7, 1.1};
  Eigen::Vector2d size_m{0.05, 0.15};  // each side of a solid (ModelInfo::solid)
  double texture_share = 0.4;          // of objects with a pattern; the others have plain paint
  double room_texture_share = 0.5;     // of table, floor and walls that are not the usual ones
  Eigen::Vector2d speed{0.05, 0.25};   // metres a second, the mean of a drive
  double gap_m = 0.02;   // between the circles around the footprints of scripted objects, always
  double in_view = 0.9;  // share of the frames in which an object is in view, at least

  std::vector<std::string> camera_paths{"arc", "orbit", "spline"};  // each as likely
  double handheld_share = 0.3;
  Eigen::Vector2d camera_radius_m{1.1, 1.5};
  Eigen::Vector2d camera_height_m{0.5, 0.9};   // above the table
  Eigen::Vector2d camera_azimuth_deg{0, 360};  // where it starts
  Eigen::Vector2d camera_sweep_deg{20, 70};    // how far it goes, to either side
  Eigen::Vector2d jitter_mm{1, 5};
  Eigen::Vector2d jitter_deg{0.1, 0.6};
  LightRanges lights;
};

// Whether the file is a random scene: it has a table [random].
bool IsRandomScene(const toml::table& root);
// Errors: kUsage, with file, line and key.
Expected<RandomSceneConfig> ReadRandomScene(const toml::table& root, const std::string& where);

}  // namespace tsdfpp
