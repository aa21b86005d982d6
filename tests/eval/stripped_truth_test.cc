// A map may depend on no truth that its settings do not use.
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <string>

#include "mapper/pipeline.h"
#include "tests/eval/seen_surface.h"
#include "tests/mapper/map_snapshot.h"

namespace tsdfpp {
namespace {

constexpr int kLastFrame = 14;  // the car sets off in frame 4

struct MappedFrames {
  std::string map;
  std::map<InstanceId, std::map<int, Pose>> trajectories;
};

MappedFrames MapFrames(Method method, PoseSource poses, const SequenceInfo& info,
                       const std::vector<Frame>& frames,
                       Segmentation segmentation = Segmentation::kGiven) {
  PipelineConfig config;
  config.segmentation = segmentation;
  config.method = method;
  config.poses = poses;
  Pipeline pipeline(config, info.objects);
  for (const Frame& frame : frames) pipeline.Process(frame).value();
  return {SnapshotOf(pipeline.map(), pipeline.map().Objects()), pipeline.trajectories()};
}

TEST(StrippedTruth, IcpDoesNotReadTheTruePoses) {
  const auto set = ReadFrames("mini", 1, kLastFrame);
  ASSERT_TRUE(set.has_value()) << set.error().message;
  std::vector<Frame> stripped = set->frames;
  std::vector<Frame> poisoned = set->frames;
  for (std::size_t i = 0; i < stripped.size(); ++i) {
    ASSERT_FALSE(stripped[i].T_WO.empty());
    stripped[i].T_WO.clear();
    for (auto& [id, T_WO] : poisoned[i].T_WO) {
      T_WO.translation() += Eigen::Vector3d(0.01 * static_cast<double>(i), 0.2, -0.1);
    }
  }
  for (const Method method : {Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored}) {
    const MappedFrames whole = MapFrames(method, PoseSource::kIcp, set->info, set->frames);
    // The car was tracked, so that there was something for a leak to change.
    const auto car = whole.trajectories.find(1);
    ASSERT_NE(car, whole.trajectories.end()) << MethodName(method);
    EXPECT_GT(car->second.rbegin()->second.translation().norm(), 0.01) << MethodName(method);
    // No EXPECT_EQ: a failure would print the maps.
    EXPECT_TRUE(whole.map == MapFrames(method, PoseSource::kIcp, set->info, stripped).map)
        << MethodName(method) << " differs without the true poses";
    EXPECT_TRUE(whole.map == MapFrames(method, PoseSource::kIcp, set->info, poisoned).map)
        << MethodName(method) << " differs with wrong poses in the frames";
    // The setting that does use them notices.
    EXPECT_FALSE(MapFrames(method, PoseSource::kGiven, set->info, set->frames).map ==
                 MapFrames(method, PoseSource::kGiven, set->info, poisoned).map)
        << MethodName(method);
  }
}

TEST(StrippedTruth, NoMasksDoesNotReadTheMasks) {
  const auto set = ReadFrames("mini", 1, 6);
  ASSERT_TRUE(set.has_value()) << set.error().message;
  std::vector<Frame> stripped = set->frames;
  std::vector<Frame> poisoned = set->frames;
  for (std::size_t i = 0; i < stripped.size(); ++i) {
    stripped[i].mask = cv::Mat();
    // A new image: the frames' copies share their pixels.
    cv::Mat flipped;
    cv::flip(set->frames[i].mask, flipped, 0);
    poisoned[i].mask = flipped;
  }
  for (const Method method : {Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored}) {
    const auto map = [&](const std::vector<Frame>& frames, Segmentation segmentation) {
      return MapFrames(method, PoseSource::kGiven, set->info, frames, segmentation).map;
    };
    const std::string whole = map(set->frames, Segmentation::kNone);
    EXPECT_TRUE(whole == map(stripped, Segmentation::kNone))
        << MethodName(method) << " differs without masks";
    EXPECT_TRUE(whole == map(poisoned, Segmentation::kNone))
        << MethodName(method) << " differs with wrong masks";
    // The setting that does use them notices.
    EXPECT_FALSE(whole == map(set->frames, Segmentation::kGiven)) << MethodName(method);
    EXPECT_FALSE(map(set->frames, Segmentation::kGiven) == map(poisoned, Segmentation::kGiven))
        << MethodName(method);
    PipelineConfig config;
    config.method = method;
    Pipeline pipeline(config, set->info.objects);
    const auto refused = pipeline.Process(stripped.front());
    ASSERT_FALSE(refused.has_value());
    EXPECT_NE(refused.error().message.find("its mask image is 0x0"), std::string::npos)
        << refused.error().message;
  }
}

// Names and the reveal plan are for people; only whether an object has a class is a setting (paper
// III-D: what was classified is tracked).
TEST(StrippedTruth, NamesDoNotMatter) {
  const auto set = ReadFrames("mini", 1, 6);
  ASSERT_TRUE(set.has_value()) << set.error().message;
  SequenceInfo renamed = set->info;
  for (ObjectInfo& object : renamed.objects) {
    object.name = "object" + std::to_string(object.id);
    if (!object.semantic_class.empty()) object.semantic_class = "thing";
  }
  for (const PoseSource poses : {PoseSource::kGiven, PoseSource::kIcp}) {
    EXPECT_TRUE(MapFrames(Method::kTsdfppAnchored, poses, set->info, set->frames).map ==
                MapFrames(Method::kTsdfppAnchored, poses, renamed, set->frames).map)
        << PoseSourceName(poses);
  }
}

}  // namespace
}  // namespace tsdfpp
