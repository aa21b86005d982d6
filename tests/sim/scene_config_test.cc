// What a scene file may say, and the sentence for each way to get it wrong.
#include "sim/scene_config.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/sim/scene_files.h"

namespace tsdfpp {
namespace {

// A whole scene, with one line to replace in each test below.
const char* const kScene = R"(name = "test"
purpose = "For tests."
frames = 10
rate_hz = 30
[camera]
width = 64
height = 48
f = 50.0
cx = 32
cy = 24
target = [0, 0, 0.74]
azimuth_deg = [-100, -80]
radius_m = [1.2, 1.2]
height_m = [0.8, 0.8]
[[object]]
name = "truck"
id = 1
class = "truck"
model = "truck"
x = 0.1
y = 0.1
yaw_deg = 30
[object.drive]
start_frame = 2
end_frame = 9
ramp_s = 0.1
x = [0.2]
y = [0.3]
[[object]]
name = "mug"
id = 2
class = "mug"
model = "mug"
x = -0.3
y = 0
[experiment]
reveal_frame = 8
removed = ["truck"]
)";

std::string With(const std::string& line, const std::string& instead) {
  std::string text = kScene;
  const std::size_t at = text.find(line);
  EXPECT_NE(at, std::string::npos) << line;
  return text.replace(at, line.size(), instead);
}

std::string FaultOf(const std::string& text) {
  const auto config = ParseSceneConfig(text, "s.toml");
  if (config) return "no fault";
  EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
  return config.error().message;
}

TEST(SceneConfig, ReadsAWholeScene) {
  const auto config = ParseSceneConfig(kScene, "s.toml");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  EXPECT_EQ(config->name, "test");
  EXPECT_EQ(config->frames, 10);
  EXPECT_EQ(config->intrinsics, (Intrinsics{64, 48, 50, 50, 32, 24}));
  ASSERT_EQ(config->objects.size(), 2U);
  EXPECT_EQ(config->objects[0].id, 1);
  ASSERT_TRUE(config->objects[0].drive.has_value());
  EXPECT_EQ(config->objects[0].drive->end_frame, 9);
  EXPECT_FALSE(config->objects[1].drive.has_value());
  EXPECT_EQ(config->experiment->removed, std::vector<std::string>{"truck"});
}

TEST(SceneConfig, FocalLengthsMayDiffer) {
  const auto config = ParseSceneConfig(With("f = 50.0", "fx = 50.0\nfy = 51.0"), "s.toml");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  EXPECT_EQ(config->intrinsics.fy, 51.0);
}

TEST(SceneConfig, SaysWhatIsWrongAndWhere) {
  const std::vector<std::array<std::string, 3>> faults{
      {"frames = 10", "frames = 0", "s.toml:3: 'frames' is 0, expected 1 to 100000"},
      {"frames = 10", "frames = 1.5",
       "s.toml:3: 'frames' is a floating-point number, expected a whole number"},
      {"rate_hz = 30", "rate_hz = 0", "s.toml:4: 'rate_hz' is 0, expected 0.1 to 1000"},
      {"name = \"test\"", "name = \"My Scene\"",
       "s.toml:1: 'name' is 'My Scene', expected lower-case letters, digits and '_'"},
      {"frames = 10", "frames = 10\nframe_rate = 3",
       "s.toml:4: 'frame_rate' is not a known key here"},
      {"width = 64\n", "", "'camera.width' is missing"},
      {"f = 50.0", "f = -1.0", "s.toml:8: 'camera.f' is -1, expected a positive number"},
      {"f = 50.0", "f = 50.0\nfx = 50.0",
       "s.toml:8: 'camera.f' stands beside fx or fy: give one or the other"},
      {"f = 50.0\n", "", "'camera.f' is missing (or both fx and fy)"},
      {"cx = 32", "cx = 99", "s.toml:9: 'camera.cx' is 99, expected 0 to 64"},
      {"azimuth_deg = [-100, -80]", "azimuth_deg = [-100]",
       "s.toml:12: 'camera.azimuth_deg' needs two keys at least"},
      {"radius_m = [1.2, 1.2]", "radius_m = [1.2]",
       "s.toml:13: 'camera.radius_m' has 1 keys, azimuth_deg has 2"},
      {"height_m = [0.8, 0.8]", "height_m = [0.8, -0.8]",
       "s.toml:14: 'camera.height_m' has -0.8, expected positive numbers"},
      {"radius_m = [1.2, 1.2]", "radius_m = [1.2, 5.0]",
       "s.toml:13: 'camera.radius_m' and the other keys put the camera at"},
      {"id = 1", "id = 2", "'object[1].id' is 2, which 'truck' has already"},
      {"id = 1", "id = 0", "s.toml:17: 'object[0].id' is 0, expected 1 to 255"},
      {"name = \"mug\"", "name = \"truck\"",
       "'object[1].name' is 'truck', which another object has already"},
      {"name = \"mug\"", "name = \"background\"",
       "'object[1].name' is 'background', which is id 0's name"},
      {"model = \"mug\"", "model = \"teapot\"",
       "'object[1].model' is 'teapot', expected one of: truck, car, mug, ball, house, blocks"},
      {"x = 0.1", "x = 1.1",
       "s.toml:20: 'object[0].x' has 1.1, which is off the table: expected -0.8 to 0.8 m"},
      {"end_frame = 9", "end_frame = 2",
       "s.toml:25: 'object[0].drive.end_frame' is 2, expected more than start_frame (2)"},
      {"start_frame = 2", "start_frame = 20",
       "s.toml:24: 'object[0].drive.start_frame' is 20, expected 1 to 10"},
      {"ramp_s = 0.1", "ramp_s = 3.0",
       "s.toml:26: 'object[0].drive.ramp_s' is 3, expected 0 to 0.11"},
      {"x = [0.2]", "x = [0.2, 0.3]", "s.toml:28: 'object[0].drive.y' has 1 numbers, x has 2"},
      {"x = [0.2]\ny = [0.3]", "x = [0.1]\ny = [0.1]",
       "s.toml:27: 'object[0].drive.x' and 'y' name the same waypoint twice in a row"},
      {"x = [0.2]", "x = [0.2]\nspeed = 3",
       "s.toml:28: 'object[0].drive.speed' is not a known key here"},
      {"reveal_frame = 8", "reveal_frame = 11",
       "'experiment.reveal_frame' is 11, expected 1 to 10"},
      {"removed = [\"truck\"]", "removed = [\"lorry\"]",
       "'experiment.removed' names 'lorry', which is no object of this scene"},
      {"removed = [\"truck\"]", "removed = [\"truck\", \"truck\"]",
       "'experiment.removed' names 'truck' twice"},
      {"removed = [\"truck\"]", "removed = []", "'experiment.removed' names no object"},
      {"[camera]", "[camera", "s.toml:5:8: not valid TOML"},
  };
  for (const auto& [line, instead, sentence] : faults) {
    const std::string fault = FaultOf(With(line, instead));
    EXPECT_NE(fault.find(sentence), std::string::npos)
        << "found:    " << fault << "\nexpected: " << sentence;
  }
}

TEST(SceneConfig, MissingFile) {
  const auto config = LoadSceneConfig("/nowhere/scene.toml");
  ASSERT_FALSE(config.has_value());
  EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
  EXPECT_NE(config.error().message.find("/nowhere/scene.toml"), std::string::npos);
}

TEST(SceneConfig, TheProjectsScenesAreRead) {
  EXPECT_EQ(LoadScene("toycar3").intrinsics, (Intrinsics{960, 540, 564.3, 564.3, 480, 270}));
  EXPECT_EQ(LoadScene("toycar3").frames, 480);
  EXPECT_EQ(LoadScene("toycar3").experiment->reveal_frame, 256);
  EXPECT_EQ(LoadScene("static").frames, 120);
  EXPECT_EQ(LoadScene("mini").intrinsics.width, 320);
}

// The negative control is the same room with nobody at the wheel.
TEST(SceneConfig, StaticIsToycar3AtRest) {
  const SceneConfig moving = LoadScene("toycar3");
  const SceneConfig still = LoadScene("static");
  ASSERT_EQ(still.objects.size(), moving.objects.size());
  for (std::size_t i = 0; i < still.objects.size(); ++i) {
    EXPECT_EQ(still.objects[i].name, moving.objects[i].name);
    EXPECT_EQ(still.objects[i].model, moving.objects[i].model);
    EXPECT_EQ(still.objects[i].x, moving.objects[i].x);
    EXPECT_EQ(still.objects[i].y, moving.objects[i].y);
    EXPECT_EQ(still.objects[i].yaw_deg, moving.objects[i].yaw_deg);
    EXPECT_FALSE(still.objects[i].drive.has_value());
  }
  EXPECT_EQ(still.intrinsics, moving.intrinsics);
  EXPECT_EQ(still.camera.azimuth_deg, moving.camera.azimuth_deg);
}

}  // namespace
}  // namespace tsdfpp
