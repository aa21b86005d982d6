// What a scene file may say, and the sentence for each way to get it wrong.
#include "sim/config/scene_config.h"

#include <gtest/gtest.h>

#include <string>

#include "core/files.h"
#include "sim/load_scene.h"
#include "tests/core/temp_folder.h"
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
       "'object[1].model' is 'teapot', expected one of: truck, car, mug, ball, house, blocks, "
       "cube"},
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
       "s.toml:27: 'object[0].drive.x' and 'y' begin at the object's own place, from which it "
       "drives "
       "off"},
      {"x = [0.2]\ny = [0.3]", "x = [0.2, 0.2]\ny = [0.3, 0.3]",
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

// A cube in the place of the mug, with one line to replace in each test below.
std::string WithCube(const std::string& lines) {
  return With(
      "name = \"mug\"\nid = 2\nclass = \"mug\"\nmodel = \"mug\"\nx = -0.3\ny = 0\n",
      "name = \"cube\"\nid = 2\nclass = \"block\"\nmodel = \"cube\"\nx = -0.3\ny = 0\n" + lines);
}

TEST(SceneConfig, SaysWhatIsWrongWithMotions) {
  const std::vector<std::pair<std::string, std::string>> faults{
      {"keyframe = [{ frame = 2 }]", "'object[1].keyframe' needs two at least"},
      {"keyframe = [{ frame = 2 }, { frame = 2 }]",
       "'object[1].keyframe[1].frame' is 2, expected more than the key before it (2)"},
      {"keyframe = [{ frame = 2 }, { frame = 11 }]",
       "'object[1].keyframe[1].frame' is 11, expected 1 to 10"},
      {"keyframe = [{ frame = 2 }, { frame = 4, position = [1, 2] }]",
       "'object[1].keyframe[1].position' has 2 numbers, expected 3"},
      {"keyframe = [{ frame = 2 }, { frame = 4, quaternion = [1, 1, 0, 0] }]",
       "'object[1].keyframe[1].quaternion' has length 1.414"},
      {"keyframe = [{ frame = 2 }, { frame = 4, quaternion = [0, 0, 1] }]",
       "'object[1].keyframe[1].quaternion' has 3 numbers, expected 4: x, y, z, w"},
      {"keyframe = [{ frame = 2 }, { frame = 4, quaternion = [0, 0, 0, 1], rpy_deg = [0, 0, 0] }]",
       "'object[1].keyframe[1].quaternion' stands beside rpy_deg"},
      {"keyframe = [{ frame = 2 }, { frame = 4, yaw = 3 }]",
       "'object[1].keyframe[1].yaw' is not a known key here"},
      {"keyframe = [{ frame = 2 }, { frame = 4 }]\n[object.physics]\n",
       "'object[1].name' has more than one of: drive, keyframe, physics"},
      {"pitch_deg = 3\n[object.drive]\nstart_frame = 1\nend_frame = 9\nx = [0]\ny = [0]",
       "'object[1].drive' is for objects that stand upright"},
      {"z = -0.1", "'object[1].z' is -0.1, expected 0 to 2.6"},
      {"scale = 0", "'object[1].model' cannot be made: "},
      {"paint = [1, 2]", "'object[1].paint' is no colour"},
      {"paint = [1, 2, 256]", "'object[1].paint' is no colour"},
      {"material = \"gold\"", "'object[1].model' cannot be made: "},
      {"texture_seed = -1", "'object[1].texture_seed' is -1, expected 0 or more"},
      {"texture_seed = 1.5", "'object[1].texture_seed' is a floating-point number"},
      {"picture = \"x.png\"", "'object[1].picture' is for models from files only"},
      {"[object.physics]\nmass_kg = 0", "'object[1].physics.mass_kg' is 0, expected 0.001 to 1000"},
      {"[object.physics]\nfriction = -1", "'object[1].physics.friction' is -1, expected 0 to 10"},
      {"[object.physics]\nstart_frame = 0",
       "'object[1].physics.start_frame' is 0, expected 1 to 10"},
      {"[object.physics]\nvelocity = [30, 0, 0]",
       "'object[1].physics.velocity' is 30 m/s, expected 20 at most"},
      {"[object.physics]\nbounce = 1", "'object[1].physics.bounce' is not a known key here"},
  };
  for (const auto& [lines, sentence] : faults) {
    const std::string fault = FaultOf(WithCube(lines + "\n"));
    EXPECT_NE(fault.find(sentence), std::string::npos)
        << "found:    " << fault << "\nexpected: " << sentence;
  }
}

// Also those that no double holds, and the largest whole number of TOML.
TEST(SceneConfig, SeedsComeBackToTheLastDigit) {
  for (const std::uint64_t seed : {9007199254740993ULL, 9223372036854775807ULL}) {
    const std::string text =
        fmt::format("seed = {}\n", seed) +
        With("x = -0.3\n", fmt::format("x = -0.3\ntexture_seed = {}\n", seed)) +
        fmt::format("[room.table_texture]\npattern = \"planks\"\nseed = {}\n", seed);
    const auto config = ParseSceneConfig(text, "s.toml");
    ASSERT_TRUE(config.has_value()) << config.error().message;
    const auto again = ParseSceneConfig(SceneToToml(*config), "again.toml");
    ASSERT_TRUE(again.has_value()) << again.error().message;
    for (const auto* scene : {&*config, &*again}) {
      EXPECT_EQ(scene->seed, seed);
      EXPECT_EQ(scene->objects[1].model.seed, seed);
      EXPECT_EQ(scene->room.table_texture->seed, seed);
    }
  }
}

TEST(SceneConfig, SaysWhatIsWrongWithCamerasAndRooms) {
  const std::string arc =
      "target = [0, 0, 0.74]\nazimuth_deg = [-100, -80]\nradius_m = [1.2, 1.2]\n"
      "height_m = [0.8, 0.8]\n";
  const std::string spline = "path = \"spline\"\nkey = ";
  const std::vector<std::pair<std::string, std::string>> faults{
      {"path = \"helix\"\n",
       "'camera.path' is 'helix', expected one of: arc, orbit, spline, recorded"},
      {"path = \"orbit\"\ntarget = [0, 0, 0.7]\nheight_m = 0.5\n", "'camera.radius_m' is missing"},
      {"path = \"orbit\"\ntarget = [0, 0, 0.7]\nheight_m = 0.5\nradius_m = -1\n",
       "'camera.radius_m' is -1, expected a positive number"},
      {"path = \"orbit\"\ntarget = [0, 0, 0.7]\nheight_m = 0.5\nradius_m = 4\n",
       "'camera.path' and the other keys put the camera at"},
      {spline + "[{ frame = 1, position = [0, 1, 1], target = [0, 0, 0] }]\n",
       "'camera.key' needs two at least"},
      {spline + "[{ frame = 1, position = [0, 0, 1], target = [0, 0, 0] }]\n",
       "'camera.key[0].target' is straight above or below the position"},
      {spline + "[{ frame = 3, position = [0, 1, 1], target = [0, 0, 0] }, "
                "{ frame = 2, position = [0, 1, 1], target = [0, 0, 0] }]\n",
       "'camera.key[1].frame' is 2, expected more than the key before it (3)"},
      {"path = \"recorded\"\nfile = \"nowhere.txt\"\nposition = [0, -1, 1]\n"
       "target = [0, 0, 0.7]\n",
       "nowhere.txt"},
      {arc + "[camera.jitter]\nposition_mm = -1\n",
       "'camera.jitter.position_mm' is -1, expected 0 to 100"},
      {arc + "[camera.jitter]\nlowest_hz = 5\nhighest_hz = 2\n",
       "'camera.jitter.highest_hz' is 2, expected more than lowest_hz (5)"},
      {arc + "[room]\nhalf_x = 1\n", "s.toml: room."},
      {arc + "[room.wall_texture]\npattern = \"fog\"\n", "s.toml: room.wall_texture"},
      {arc + "[room]\nroof = false\n", "'room.roof' is not a known key here"},
      {arc + "[lights]\nambient = 3\n", "s.toml: lights."},
      {arc + "[physics]\ntimestep_s = 1\n", "'physics.timestep_s' is 1, expected 0.0001 to 0.005"},
      {arc + "[sensor]\npreset = \"eagle\"\n", "'sensor.preset'"},
  };
  for (const auto& [lines, sentence] : faults) {
    const auto config = ParseSceneConfig(With(arc, lines), "s.toml");
    ASSERT_FALSE(config.has_value()) << lines;
    EXPECT_NE(config.error().message.find(sentence), std::string::npos)
        << "found:    " << config.error().message << "\nexpected: " << sentence;
  }
}

// Every scene can be written and read back, and is the same file then.
TEST(SceneConfig, ScenesSurviveTheirTrip) {
  for (const char* name : kScenes) {
    const SceneConfig config = LoadScene(name);
    const std::string text = SceneToToml(config);
    const auto read = ParseSceneConfig(text, "trip.toml");
    ASSERT_TRUE(read.has_value()) << read.error().message;
    EXPECT_EQ(SceneToToml(*read), text);
    EXPECT_EQ(read->intrinsics, config.intrinsics);
    EXPECT_EQ(read->frames, config.frames);
    ASSERT_EQ(read->objects.size(), config.objects.size());
    for (std::size_t i = 0; i < config.objects.size(); ++i) {
      const ObjectMotion a(config.objects[i], config.rate_hz);
      const ObjectMotion b(read->objects[i], config.rate_hz);
      for (int frame = 1; frame <= config.frames; frame += 7) {
        EXPECT_EQ(a.T_WO(frame).matrix(), b.T_WO(frame).matrix()) << name << " " << i;
      }
    }
  }
}

// A mesh file is named relative to the scene's own folder.
TEST(SceneConfig, MeshFilesStartAtTheScenesFolder) {
  const test::TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "meshes/cow.obj", "").has_value());
  const auto config = ParseSceneConfig(
      With("model = \"mug\"", "model = \"../meshes/cow.obj\"\nscale = 0.06\nup = \"y\""), "s.toml",
      folder / "scenes");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  EXPECT_EQ(config->objects[1].model.name, kMeshModel);
  EXPECT_EQ(config->objects[1].model.file, folder / "meshes/cow.obj");
  EXPECT_EQ(config->objects[1].model.up, "y");
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
    EXPECT_EQ(still.objects[i].model.name, moving.objects[i].model.name);
    EXPECT_EQ(still.objects[i].x, moving.objects[i].x);
    EXPECT_EQ(still.objects[i].y, moving.objects[i].y);
    EXPECT_EQ(still.objects[i].yaw_deg, moving.objects[i].yaw_deg);
    EXPECT_FALSE(still.objects[i].drive.has_value());
  }
  EXPECT_EQ(still.intrinsics, moving.intrinsics);
  EXPECT_EQ(std::get<ArcPath>(still.camera.path).azimuth_deg,
            std::get<ArcPath>(moving.camera.path).azimuth_deg);
}

}  // namespace
}  // namespace tsdfpp
