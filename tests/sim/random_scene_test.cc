// Scenes drawn from ranges: apart at the start, in view, the same for the same seed, writable.
#include "sim/motion/random_scene.h"

#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <set>

#include "core/pose_text.h"
#include "core/toml_reader.h"
#include "sim/load_scene.h"
#include "tests/sim/footprint.h"
#include "tests/sim/scene_files.h"
#include "tests/sim/scene_geometry.h"

namespace tsdfpp {
namespace {

RandomSceneConfig Ranges() {
  const std::string file = std::string(TSDFPP_SOURCE_DIR) + "/scenes/random.toml";
  const auto root = ParseTomlFile(file);
  EXPECT_TRUE(root.has_value());
  auto config = ReadRandomScene(*root, file);
  EXPECT_TRUE(config.has_value()) << config.error().message;
  // Fewer frames at a lower rate: as long, and quicker to simulate.
  config->frames = 40;
  config->rate_hz = 10;
  return std::move(config.value());
}

SceneConfig Draw(const RandomSceneConfig& ranges, std::uint64_t seed) {
  auto scene = DrawRandomScene(ranges, seed);
  EXPECT_TRUE(scene.has_value()) << scene.error().message;
  return std::move(scene.value());
}

// By its vertices, not by the circles that the draw used.
TEST(RandomScene, NothingIntersectsAtTheStartAndScriptedThingsNever) {
  const RandomSceneConfig ranges = Ranges();
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const SceneConfig scene = Draw(ranges, seed);
    SCOPED_TRACE(seed);
    EXPECT_GE(scene.objects.size(), 3U);
    EXPECT_LE(scene.objects.size(), 8U);
    const SceneMotion motion = MotionOf(scene);
    const std::vector<Solid> solids = SolidsOf(scene);
    EXPECT_EQ(DeepestOverlap(solids, motion.T_WO(1)), 0);
    EXPECT_LE(DeepestInGround(solids, motion.T_WO(1), scene.room), 1e-9);
    constexpr int kEvery = 3;
    for (int frame = 1; frame <= scene.frames; frame += kEvery) {
      const auto T_WO = motion.T_WO(frame);
      std::map<InstanceId, Outline> outlines;
      for (std::size_t i = 0; i < solids.size(); ++i) {
        if (frame > 1 && scene.objects[i].physics) continue;
        outlines[solids[i].id] = FootprintOf(solids[i].parts, T_WO.at(solids[i].id));
      }
      for (const auto& [id, outline] : outlines) {
        for (const auto& [other_id, other] : outlines) {
          if (id >= other_id) continue;
          EXPECT_GT(Gap(outline, other), 0) << id << " and " << other_id << " in frame " << frame;
        }
      }
    }
  }
}

// The share of an object's vertices that fall into the image, straight from the definition.
TEST(RandomScene, ObjectsAreInViewForTheStatedShare) {
  const RandomSceneConfig ranges = Ranges();
  for (std::uint64_t seed = 11; seed <= 12; ++seed) {
    const SceneConfig scene = Draw(ranges, seed);
    const SceneMotion motion = MotionOf(scene);
    const Intrinsics& k = scene.intrinsics;
    for (const Solid& solid : SolidsOf(scene)) {
      int frames = 0;
      for (int frame = 1; frame <= scene.frames; ++frame) {
        const Pose T_CO = motion.T_WC(frame).inverse() * motion.T_WO(frame).at(solid.id);
        int inside = 0;
        int all = 0;
        for (const ModelPart& part : solid.parts) {
          for (const Eigen::Vector3d& p_O : part.shape.vertices) {
            const Eigen::Vector3d p = T_CO * p_O;
            const double u = k.fx * p.x() / p.z() + k.cx;
            const double v = k.fy * p.y() / p.z() + k.cy;
            inside += p.z() > 0 && u > 0 && v > 0 && u < k.width && v < k.height ? 1 : 0;
            ++all;
          }
        }
        // Half of the box's corners in the image leave a quarter of the vertices at the very least.
        frames += inside > all / 4 ? 1 : 0;
      }
      EXPECT_GE(frames, ranges.in_view * scene.frames) << "seed " << seed << ", id " << solid.id;
    }
  }
}

TEST(RandomScene, ASeedIsAScene) {
  const RandomSceneConfig ranges = Ranges();
  std::set<std::string> texts;
  for (const std::uint64_t seed : {1, 2, 3}) {
    const std::string text = SceneToToml(Draw(ranges, seed));
    EXPECT_EQ(text, SceneToToml(Draw(ranges, seed)));
    texts.insert(text.substr(text.find("[camera]")));
  }
  EXPECT_EQ(texts.size(), 3U);
}

// What was drawn can be written as an ordinary scene, read, and moves the same.
TEST(RandomScene, ADrawnSceneIsAnOrdinaryFile) {
  const RandomSceneConfig ranges = Ranges();
  constexpr std::uint64_t kLargest = std::numeric_limits<std::int64_t>::max();
  for (const std::uint64_t seed : {std::uint64_t{5}, std::uint64_t{6}, kLargest}) {
    const SceneConfig drawn = Draw(ranges, seed);
    const std::string text = SceneToToml(drawn);
    const auto read = ParseSceneConfig(text, "drawn.toml");
    ASSERT_TRUE(read.has_value()) << read.error().message << "\n" << text;
    EXPECT_EQ(SceneToToml(*read), text);
    const PoseTable a = MotionOf(drawn).Table();
    const PoseTable b = MotionOf(*read).Table();
    for (std::size_t i = 0; i < a.T_WC.size(); ++i) {
      EXPECT_EQ(PoseToText(a.T_WC[i]), PoseToText(b.T_WC[i]));
      for (const auto& [id, poses] : a.T_WO) {
        EXPECT_EQ(PoseToText(poses[i]), PoseToText(b.T_WO.at(id)[i]))
            << id << " in frame " << i + 1;
      }
    }
  }
}

TEST(RandomScene, WhatCannotBePlacedIsSaid) {
  RandomSceneConfig ranges = Ranges();
  ranges.motions = {RandomMotion::kRest};
  ranges.objects = {60, 60};
  ranges.scale = {1, 1};
  const auto scene = DrawRandomScene(ranges, 1);
  ASSERT_FALSE(scene.has_value());
  EXPECT_EQ(scene.error().kind, ErrorKind::kUsage);
  EXPECT_NE(scene.error().message.find("found no place apart from the others"), std::string::npos)
      << scene.error().message;
}

TEST(RandomScene, SaysWhatIsWrongAndWhere) {
  const std::string text = R"(name = "r"
purpose = "Random."
frames = 30
rate_hz = 10
[camera]
width = 64
height = 48
f = 50
cx = 32
cy = 24
[random]
objects = [2, 3]
models = ["cube", "car"]
motions = ["rest"]
[random.camera]
paths = ["arc"]
)";
  const auto fault = [&](const std::string& line, const std::string& instead) {
    std::string changed = text;
    changed.replace(changed.find(line), line.size(), instead);
    const auto root = ParseToml(changed, "r.toml");
    EXPECT_TRUE(root.has_value()) << changed;
    const auto config = ReadRandomScene(*root, "r.toml");
    return config ? std::string("no fault") : config.error().message;
  };
  EXPECT_EQ(fault("frames = 30", "frames = 30"), "no fault");
  const std::vector<std::array<std::string, 3>> faults{
      {"objects = [2, 3]", "objects = [3, 2]",
       "r.toml:12: 'random.objects' is [3, 2], expected [low, high] within 1 and 255"},
      {"objects = [2, 3]", "objects = [2.5, 3]", "'random.objects' has no whole numbers"},
      {"objects = [2, 3]", "objects = 3", "'random.objects' is an integer"},
      {"\"car\"", "\"cat\"", "'random.models' has 'cat', which is no model"},
      {"models = [\"cube\", \"car\"]", "models = []", "'random.models' is empty"},
      {"\"rest\"", "\"fly\"", "'random.motions' has 'fly', expected rest, drive, carry or drop"},
      {"\"arc\"", "\"helix\"", "'random.camera.paths' has 'helix', expected arc, orbit or spline"},
      {"paths = [\"arc\"]", "speed = 1", "'random.camera.speed' is not a known key here"},
      {"motions = [\"rest\"]", "motions = [\"rest\"]\nin_view = 2",
       "'random.in_view' is 2, expected 0 to 1"},
      {"cy = 24", "cy = 24\ntarget = [0, 0, 0]", "'camera.target' is not a known key here"},
  };
  for (const auto& [line, instead, sentence] : faults) {
    const std::string found = fault(line, instead);
    EXPECT_NE(found.find(sentence), std::string::npos)
        << "found:    " << found << "\nexpected: " << sentence;
  }
}

// The loader draws where the file has ranges.
TEST(RandomScene, LoadingWithASeedDraws) {
  const std::string file = std::string(TSDFPP_SOURCE_DIR) + "/scenes/random.toml";
  const auto scene = LoadSceneConfig(file, 3);
  ASSERT_TRUE(scene.has_value()) << scene.error().message;
  EXPECT_EQ(scene->seed, 3U);
  EXPECT_EQ(scene->name, "random");
  EXPECT_EQ(scene->frames, 150);
}

}  // namespace
}  // namespace tsdfpp
