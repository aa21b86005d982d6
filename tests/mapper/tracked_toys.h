// What the tests of the tracker `track` share: the toys that it follows, and what is frozen.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "mapper/pipeline.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {

// A pixel sees some 8 mm of these scenes, 0.4 voxel; distances are those of the nearest pixel.
inline constexpr double kPixel_voxels = 0.4;

inline std::vector<ObjectInfo> Toys(const std::string& semantic_class = "toy") {
  return {{kBackground, "background", ""},
          {kBrick, "brick", semantic_class},
          {kTray, "tray", semantic_class}};
}

inline PipelineConfig TrackConfig(Method method = Method::kTsdfppAnchored) {
  PipelineConfig config;
  config.method = method;
  config.map = ToyConfig();
  config.poses = PoseSource::kTrack;
  return config;
}

// The frame of a network that takes the brick for the tray.
inline Frame WithToysSwapped(Frame frame) {
  const cv::Mat brick = frame.mask == kBrick;
  frame.mask.setTo(kBrick, frame.mask == kTray);
  frame.mask.setTo(kTray, brick);
  return frame;
}

// What is frozen stays, in pose and in values.
inline void ExpectFrozen(Pipeline& pipeline, const Frame& frame,
                         const std::vector<InstanceId>& ids) {
  struct Before {
    Pose T_WO;
    std::vector<Eigen::Vector3i> voxels;
    int frozen = 0;
  };
  std::map<InstanceId, Before> before;
  for (const InstanceId id : ids) {
    before[id] = {pipeline.trajectories().at(id).rbegin()->second,
                  VoxelsOf(pipeline.map()).ObservedVoxels(id),
                  pipeline.track_log().objects().at(id).frozen};
  }
  ASSERT_TRUE(pipeline.Process(frame));
  for (const InstanceId id : ids) {
    EXPECT_EQ(pipeline.trajectories().at(id).rbegin()->second.matrix(), before[id].T_WO.matrix());
    EXPECT_EQ(VoxelsOf(pipeline.map()).ObservedVoxels(id), before[id].voxels);
    EXPECT_EQ(pipeline.track_log().objects().at(id).frozen, before[id].frozen + 1);
  }
}

}  // namespace tsdfpp
