// Association by votes on whole scenes: true masks whose ids are drawn anew in every frame, and the
// true poses. Each object has to have one id, its own, throughout.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/intrinsics.h"
#include "sim/load_scene.h"
#include "sim/sensor/mask_faults.h"
#include "sim/simulated_source.h"
#include "tests/mapper/vote_world.h"

namespace tsdfpp {
namespace {

constexpr double kImageScale = 0.5;

// What became of the objects and their pixels with valid depth.
struct Tally {
  std::set<InstanceId> born;   // true objects that have an id
  int extra_ids = 0;           // ids that true objects got beside their first ones
  std::int64_t pixels = 0;     // of objects that were born by then
  std::int64_t wrong = 0;      // with another id than the object's first
  std::int64_t left_out = 0;   // without an id
  std::int64_t of_others = 0;  // background pixels with an id
};

void Count(const VoteWorld& world, const cv::Mat& labels, const Frame& frame, Tally& tally) {
  std::map<InstanceId, InstanceId> id_of;
  for (const auto& [id, object] : world.truth_of()) id_of.emplace(object, id);  // the first
  tally.extra_ids = static_cast<int>(world.truth_of().size() - id_of.size());
  for (const auto& [object, id] : id_of) tally.born.insert(object);
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      if (!IsValidDepth(frame.depth.at<float>(v, u))) continue;
      const InstanceId object = frame.mask.at<InstanceId>(v, u);
      const InstanceId label = labels.at<InstanceId>(v, u);
      if (object == kBackground) {
        tally.of_others += label == kBackground ? 0 : 1;
        continue;
      }
      const auto id = id_of.find(object);
      if (id == id_of.end()) continue;
      ++tally.pixels;
      tally.left_out += label == kNoInstance ? 1 : 0;
      tally.wrong += label == kNoInstance || label == id->second ? 0 : 1;
    }
  }
}

Expected<Tally> Associate(const std::string& scene, int last_frame) {
  const auto file = std::filesystem::path(TSDFPP_SOURCE_DIR) / "scenes" / (scene + ".toml");
  TSDFPP_ASSIGN(SceneConfig config, LoadSceneConfig(file));
  config.intrinsics = Scaled(config.intrinsics, kImageScale);
  config.sensor.masks.flicker = {1, 1};
  SimOptions options;
  options.render_colour = false;
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(config, options));
  MapConfig map;
  TSDFPP_RETURN_IF_ERROR(map.SetProfile("close"));
  // By default as the pipeline has it where masks are not repaired: of true masks parts would be
  // left out.
  VoteConfig votes;
  if (const char* far_share = std::getenv("TSDFPP_FAR_SHARE")) {
    votes.far_share = std::atof(far_share);
  }
  VoteWorld world(Method::kTsdfppAnchored, map, votes);
  Tally tally;
  const int last = std::min(last_frame, source->info().frame_count);
  for (int index = 1; index <= last; ++index) {
    TSDFPP_ASSIGN(SensedFrame sensed, source->ReadSensed(index));
    const Segments segments{sensed.frame.mask, {}};
    Frame frame = sensed.frame;
    frame.mask = sensed.truth.mask;
    frame.colour = cv::Mat::zeros(frame.depth.size(), CV_8UC3);
    Count(world, world.Map(frame, segments), frame, tally);
  }
  return tally;
}

class AssociationScenes : public ::testing::TestWithParam<std::string> {};

// TSDFPP_ASSOCIATION_FRAMES says how many frames, 60 by default.
TEST_P(AssociationScenes, GiveEachObjectOneId) {
  const char* frames = std::getenv("TSDFPP_ASSOCIATION_FRAMES");
  const auto tally = Associate(GetParam(), frames == nullptr ? 60 : std::atoi(frames));
  ASSERT_TRUE(tally.has_value()) << tally.error().message;
  fmt::print("{}: {} objects, {} further ids, of {} pixels {} wrong, {} left out\n", GetParam(),
             tally->born.size(), tally->extra_ids, tally->pixels, tally->wrong, tally->left_out);
  EXPECT_GT(tally->born.size(), 0U);
  EXPECT_EQ(tally->extra_ids, 0);
  EXPECT_EQ(tally->wrong, 0);
  EXPECT_EQ(tally->of_others, 0);
}

// Without scenes/random.toml, where one of three objects gets a second id within 60 frames.
INSTANTIATE_TEST_SUITE_P(Scenes, AssociationScenes,
                         ::testing::Values("contact", "container", "fast", "handheld", "many",
                                           "mini", "occlusion", "parked", "reentry", "room",
                                           "stack", "static", "thin", "toycar3", "tumble"),
                         [](const auto& tested) { return tested.param; });

}  // namespace
}  // namespace tsdfpp
