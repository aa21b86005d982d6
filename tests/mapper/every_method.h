// Tests that run for each method, or for each that has voxels.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <memory>
#include <string>

#include "mapper/map_representation.h"
#include "tests/mapper/methods_of_tests.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {

class EveryMethodTest : public ::testing::TestWithParam<Method> {};

inline void SetPosesThenFuse(MapRepresentation& map, const Frame& frame) {
  for (const auto& [id, T_WO] : frame.T_WO) map.SetObjectPose(id, T_WO);
  map.Fuse(frame, frame.mask);
}

// The brick drives in a curve and turns, the others stay; the camera goes round.
inline Frame DriveFrame(int i) {
  reference::Scene scene = TableWithToys();
  scene.T_WO[kBrick] =
      reference::MakePose(0.3 + 0.2 * i, Eigen::Vector3d::UnitZ(),
                          {-0.14 + 0.03 * i, 0.03 - 0.015 * i, kTableTop_m + 0.045});
  return RenderToys(scene, 0.2 + 0.4 * i, i);
}

inline std::unique_ptr<MapRepresentation> DrivenMap(Method method, const MapConfig& config,
                                                    int frames) {
  auto map = MakeMap(method, config);
  for (int i = 0; i < frames; ++i) SetPosesThenFuse(*map, DriveFrame(i));
  return map;
}

}  // namespace tsdfpp
