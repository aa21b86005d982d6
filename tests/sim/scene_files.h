// Opens the project's own scenes.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <string>

#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {

// The scenes in scenes/ but `random`, which is drawn. What has to hold of every scene is asked of
// these; SceneFiles.ListsEveryScene notices one that is missing here.
inline constexpr std::array kScenes{"contact", "container", "fast",   "handheld", "many",
                                    "mini",    "occlusion", "parked", "reentry",  "room",
                                    "stack",   "static",    "thin",   "toycar3",  "tumble"};

inline SceneConfig LoadScene(const std::string& name) {
  auto config = LoadSceneConfig(std::string(TSDFPP_SOURCE_DIR) + "/scenes/" + name + ".toml");
  EXPECT_TRUE(config.has_value()) << config.error().message;
  return config.value();
}

inline std::unique_ptr<SimulatedSource> OpenConfig(const SceneConfig& config,
                                                   bool render_colour = false) {
  auto source = SimulatedSource::Open(config, SimOptions{render_colour});
  EXPECT_TRUE(source.has_value()) << source.error().message;
  return std::move(source.value());
}

inline SceneMotion MotionOf(const SceneConfig& config) {
  auto motion = SceneMotion::Make(config);
  EXPECT_TRUE(motion.has_value()) << motion.error().message;
  return std::move(motion.value());
}

// The ray of a pixel in the camera's frame, with z = 1.
inline Eigen::Vector3d RayOf(const Intrinsics& k, double u, double v) {
  return {(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0};
}

}  // namespace tsdfpp
