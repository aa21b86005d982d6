// Objects that a map finds in depth alone, against those of the scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "mapper/pipeline.h"
#include "metrics/trajectory.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

constexpr const char* kScene = TSDFPP_SOURCE_DIR "/scenes/toycar3.toml";
constexpr int kFrames = 60;  // both cars are under way
constexpr InstanceId kTruck = 1;
constexpr InstanceId kCar = 2;
// An object of the map counts as found from here on.
constexpr int kSettled = 10;
constexpr double kLeastSameId = 0.95;     // a frame or two may be cut otherwise
constexpr double kMostBackground = 0.05;  // a small part beside the table may be taken for it
// What waits for motion stays behind by a voxel and, while that is confirmed, some frames' way.
constexpr double kFarthest_m = 0.015;

constexpr double kNowhere_m = 1e9;

struct Followed {
  double same_id = 0;     // of the frames: the id that most of the object's pixels have is one
  double background = 0;  // of the object's pixels
  double farthest_m = 0;  // that the object with that id comes from where it should be
};

struct Following {
  std::map<InstanceId, Followed> objects;  // by the scene's ids
  std::set<InstanceId> moved;              // on which most is of what is known to have moved
};

// With a Kinect's noise; masks and poses of objects are not in the frames.
Following Follow() {
  const SceneConfig scene = LoadSceneConfig(kScene).value();
  const SensorConfig sensor = SensorPresetNamed("nguyen2012").value();
  const auto source = SimulatedSource::Open(scene, {}).value();
  const SequenceInfo& info = source->info();
  PipelineConfig config;
  config.method = Method::kTsdfppAnchored;
  config.segmentation = Segmentation::kDepth;
  config.associate = AssociationMode::kVotes;
  config.poses = PoseSource::kTrack;
  EXPECT_TRUE(config.Validate().has_value());
  Pipeline pipeline(config, {});
  std::map<InstanceId, Trajectory> truth;
  std::map<InstanceId, std::map<InstanceId, int>> frames_by_id;
  std::map<InstanceId, std::map<InstanceId, int>> pixels_by_id;
  std::map<InstanceId, std::map<InstanceId, int>> pixels_on;
  for (int passed = 0; passed < kFrames; ++passed) {
    Frame frame = source->ReadTrue(info.first_index + passed).value();
    EXPECT_TRUE(ApplySensor(sensor, scene.seed, info, frame).has_value());
    for (const auto& [of, T_WO] : frame.T_WO) truth[of][frame.index] = T_WO;
    const cv::Mat mask = frame.mask;
    frame.mask = cv::Mat();
    frame.T_WO.clear();
    EXPECT_TRUE(pipeline.Process(frame).has_value());
    if (passed < kSettled) continue;
    std::map<InstanceId, std::map<InstanceId, int>> counts;
    for (int v = 0; v < mask.rows; ++v) {
      for (int u = 0; u < mask.cols; ++u) {
        const InstanceId of = mask.at<InstanceId>(v, u);
        const InstanceId found = pipeline.labels().at<InstanceId>(v, u);
        if (of == kNoInstance || found == kNoInstance) continue;
        ++pixels_on[found][of];
        if (of == kBackground) continue;
        ++counts[of][found];
        ++pixels_by_id[of][found];
      }
    }
    for (const auto& [of, found] : counts) {
      const auto most =
          std::max_element(found.begin(), found.end(),
                           [](const auto& a, const auto& b) { return a.second < b.second; });
      ++frames_by_id[of][most->first];
    }
  }
  std::map<InstanceId, Followed> followed;
  for (const auto& [of, frames] : frames_by_id) {
    int all = 0;
    int most = 0;
    InstanceId most_id = kBackground;
    for (const auto& [id, count] : frames) {
      all += count;
      if (id == kBackground || count <= most) continue;
      most = count;
      most_id = id;
    }
    int pixels = 0;
    for (const auto& [id, count] : pixels_by_id[of]) pixels += count;
    const auto background = pixels_by_id[of].find(kBackground);
    const int lost = background == pixels_by_id[of].end() ? 0 : background->second;
    const auto poses = pipeline.trajectories().find(most_id);
    const auto errors = poses == pipeline.trajectories().end()
                            ? std::nullopt
                            : PoseErrorsOf(AnchoredAtFirst(PairByFrame(poses->second, truth[of])));
    followed[of] = {static_cast<double>(most) / all, static_cast<double>(lost) / pixels,
                    errors ? errors->translation_m.largest : kNowhere_m};
  }
  std::set<InstanceId> moved;
  for (const auto& [id, span] : pipeline.track_log().objects()) {
    const auto& on = pixels_on[id];
    if (!span.moved || on.empty()) continue;
    moved.insert(std::ranges::max_element(on, {}, [](const auto& of) { return of.second; })->first);
  }
  return {followed, moved};
}

TEST(DepthObjects, KeepTheirIdsAndAreTracked) {
  const auto [followed, moved] = Follow();
  ASSERT_GE(followed.size(), 2U);
  for (const auto& [of, found] : followed) {
    SCOPED_TRACE(of);
    EXPECT_GE(found.same_id, kLeastSameId);
    EXPECT_LE(found.background, kMostBackground);
  }
  for (const InstanceId car : {kTruck, kCar}) EXPECT_LT(followed.at(car).farthest_m, kFarthest_m);
  // Furniture is of segments, too, and stays where it is.
  EXPECT_EQ(moved, (std::set<InstanceId>{kTruck, kCar}));
}

}  // namespace
}  // namespace tsdfpp
