// Things that one types wrongly, and the very sentence for each.
#include <gtest/gtest.h>

#include <filesystem>

#include "core/files.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::kData;
using test::kUsage;
using test::RunTsdfpp;

struct Wrong {
  std::vector<std::string> words;  // '@' is the test's folder
  std::string sentence;
  int exit_code = kUsage;
};

std::string WithFolder(std::string text, const std::string& folder) {
  for (std::size_t at = text.find('@'); at != text.npos; at = text.find('@', at)) {
    text.replace(at, 1, folder);
  }
  return text;
}

TEST(Sentences, SayWhatWasFoundAndWhatWasExpected) {
  const test::TempFolder folder;
  const std::string scene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
  const std::string sets = TSDFPP_SOURCE_DIR "/eval/bench-sets";
  ASSERT_TRUE(WriteFile(folder / "file", "x").has_value());
  ASSERT_TRUE(WriteFile(folder / "letters/letter.txt", "x").has_value());
  ASSERT_TRUE(WriteFile(folder / "adapter.toml", "name = \"mine\"\ncommand = [\"true\"]\n"));
  fs::create_directories(folder / "empty");
  const auto see = [](const std::string& command) {
    return " (see tsdfpp " + command + " --help)";
  };
  const std::vector<Wrong> wrong{
      {{"verify", "@/none"}, "@/none: no such folder, expected a sequence"},
      {{"verify", scene},
       scene + ": is a scene, expected the folder of a sequence that tsdfpp generate made"},
      {{"verify", "@/file"},
       "@/file: is a file, expected the folder of a sequence that tsdfpp generate made"},
      {{"verify", "@/empty"},
       "@/empty: holds no sequence.json, expected a sequence that tsdfpp generate made",
       kData},
      {{"verify"}, "SEQ is required" + see("verify")},
      {{"verify", "@/empty", "--share", "2"},
       "--share: found '2', expected a number from 0 to 1" + see("verify")},
      {{"verify", "@/empty", "--share", "nan"},
       "--share: found 'nan', expected a number from 0 to 1" + see("verify")},
      {{"verify", "@/empty", "--share", "half"},
       "--share: found 'half', expected a number from 0 to 1" + see("verify")},
      {{"generate", scene, "--out", "@/o", "--sensor", "kinect+"},
       "sensor preset 'kinect+' leaves a name out, expected one name or several joined by '+', "
       "e.g. kinect+masks_mild"},
      {{"generate", scene, "--out", "@/o", "--sensor", ""},
       "--sensor: found nothing, expected the name of a sensor" + see("generate")},
      {{"generate", scene, "--out", "@/o", "--sensor", "kinect+d435"},
       "sensor preset 'kinect+d435' joins two that both set the same part of the sensor"},
      {{"generate", scene, "--out", "@/o", "--scale", "nan"},
       "--scale: found 'nan', expected a number from 0.05 to 4" + see("generate")},
      {{"generate", scene, "--out", "@/o", "--jobs", "1.5"},
       "--jobs: found '1.5', expected a whole number from 1 to 256" + see("generate")},
      {{"generate", scene, "--out", "@/o", "--jobs", "0"},
       "--jobs: found '0', expected a whole number from 1 to 256" + see("generate")},
      {{"generate", scene, "--out", "@/o", "--jobs", "010"},
       "--jobs: found '010', expected a whole number from 1 to 256, without a 0 before it" +
           see("generate")},
      {{"map", scene, "--out", "@/o", "--until", "010"},
       "--until: found 010, expected a number from 0, without a 0 before it" + see("map")},
      {{"generate", scene, "--out", "@/o", "--seed", "99999999999999999999"},
       "--seed: found '99999999999999999999', expected a whole number from 0 to "
       "9223372036854775807" +
           see("generate")},
      {{"generate", scene, "--out", ""},
       "--out: found nothing, expected a folder" + see("generate")},
      {{"generate", scene}, "--out is required (see tsdfpp generate --help)"},
      {{"generate", "@/empty", "--out", "@/o"},
       "@/empty: is a folder, expected a scene file (.toml)"},
      {{"generate", "@/none.toml", "--out", "@/o"}, "@/none.toml: no such file"},
      {{"generate", scene, "--out", "@/file"}, "@/file: is a file, expected a folder to make"},
      {{"generate", scene, "--out", "@/letters"},
       "@/letters: the folder holds something other than a sequence of ours, expected a new or an "
       "empty folder"},
      {{"generate", "--list", "--scenes", "@/none"},
       "@/none: no such folder, expected a folder with scenes"},
      {{"generate", "--list", "--scenes", "@/empty"},
       "@/empty: holds no .toml file, expected a folder with scenes"},
      {{"generate", "--list", "--scenes", "@/file"},
       "@/file: is a file, expected a folder with scenes"},
      {{"evaluate", scene, "--meshes", "@/none", "--at", "4"}, "--meshes @/none: no such folder"},
      {{"evaluate", scene, "--meshes", "@/empty", "--at", "4,last"},
       "--at '4,last': expected frames' numbers between commas, found 'last'"},
      {{"evaluate", scene, "--meshes", "@/empty", "--at", "99"},
       "--at 99 is out of range: mini has frames 1 to 48"},
      {{"evaluate", scene, "--meshes", "@/empty", "--at", "1"},
       "@/empty: holds no mesh of frame 1 (.ply, .obj, .stl, .glb)",
       kData},
      {{"evaluate", scene, "--meshes", "@/empty"}, "--at is required" + see("evaluate")},
      {{"evaluate", scene, "--meshes", "@/empty", "--at", "1", "--match", "luck"},
       "--match: found 'luck', expected one of names, overlap" + see("evaluate")},
      {{"evaluate", scene, "--meshes", "@/empty", "--at", "1", "--scale", "0"},
       "--scale: found 0, expected a number above 0" + see("evaluate")},
      {{"evaluate", scene, "--meshes", "@/empty", "--at", "1", "--removed", "cart"},
       "object 'cart' is not in sequence mini, which has background (0), car (1), house (2)"},
      {{"evaluate", scene, "--meshes", "@/empty", "--at", "1", "--masks", "@/none"},
       "--masks @/none: no such folder"},
      {{"compare", scene, "--out", "@/o", "--adapter", "@/none.toml"}, "@/none.toml: no such file"},
      {{"compare",   scene,    "--out",          "@/o",   "--adapter",     "@/adapter.toml",
        "--methods", "",       "--camera",       "track", "--mask-repair", "on",
        "--track",   "moving", "--segmentation", "depth", "--associate",   "votes",
        "--poses",   "track",  "--record"},
       "'--camera track --mask-repair on --track moving --segmentation depth --associate votes "
       "--poses track --record' is of our own maps, and --methods names none of them"},
      {{"export", scene, "--to", "xyz", "--out", "@/o"},
       "--to: found 'xyz', expected one of tum, bop, klg, 7scenes" + see("export")},
      {{"export", scene, "--to", "tum"}, "--out is required" + see("export")},
      {{"export", scene, "--to", "tum", "--out", ""},
       "--out: found nothing, expected a folder" + see("export")},
      {{"export", "@/none", "--to", "tum", "--out", "@/o"},
       "@/none: no such scene (a .toml file) or sequence (a folder)"},
      {{"export", "@/file", "--to", "tum", "--out", "@/o"},
       "@/file: is a file, expected the folder of a sequence or a .klg"},
      {{"export", "@/empty", "--to", "tum", "--out", "@/o", "--calibration", "@/none"},
       "--calibration @/none: no such file"},
      {{"export", "@/empty", "--to", "tum", "--out", "@/o", "--depth-units", "inf"},
       "--depth-units: found inf, expected a number above 0" + see("export")},
      {{"map", scene, "--out", ""}, "--out: found nothing, expected a folder" + see("map")},
      {{"map", scene, "--out", "@/o", "--save", ""},
       "--save: found nothing, expected a file" + see("map")},
      {{"map", "--out", "@/o", "--load", ""},
       "--load: found nothing, expected a file" + see("map")},
      {{"metric", "pose", "@/file", "@/file", "@/file", "--camera", "100,100,nan,1"},
       "--camera '100,100,nan,1': expected fx,fy,cx,cy in pixels"},
      {{"map", scene, "--out", "@/o", "--save", "@/o/stats.json"},
       "--save '@/o/stats.json' is a place of what --out '@/o' gets, expected another"},
      {{"map", scene, "--out", "@/o", "--save", "@/empty/../o/mesh/a.map"},
       "--save '@/empty/../o/mesh/a.map' is a place of what --out '@/o' gets, expected another"},
      {{"map", scene, "--out", "@/o", "--save", "@/o/.tsdfpp-run/a.map"},
       "--save '@/o/.tsdfpp-run/a.map' is a place of what --out '@/o' gets, expected another"},
      {{"map", scene, "--out", "@/o", "--save", "/dev/null"},
       "--save '/dev/null' is a device or a pipe, expected a file or nothing"},
      {{"map", scene, "--out", "@/o", "--trunc-back", "inf"},
       "--trunc-back: found inf, expected a number above 0" + see("map")},
      {{"map", scene, "--out", "@/o", "--segmentation", "net"},
       "--segmentation: found 'net', expected one of gt, none, depth, network, full" + see("map")},
      {{"compare", scene, "--out", ""}, "--out: found nothing, expected a folder" + see("compare")},
      {{"compare", scene, "--out", "@/o", "--until", "soon"},
       "--until is 'soon', expected reveal, end or a frame's number"},
      {{"compare", scene, "--out", "@/o", "--profiles", ""},
       "--methods, --profiles and --poses each need one name at least"},
      {{"compare", scene, "--out", "@/o", "--methods", "tsdf,tsdf++,tsdf"},
       "--methods names tsdf twice"},
      {{"compare", scene, "--out", "@/o", "--methods", "anchored,tsdf++/anchored"},
       "--methods names tsdf++/anchored twice"},
      {{"map", scene, "--out", "@/o", "--remove", ","}, "--remove ',' names no object"},
      {{"map", scene, "--out", "@/o", "--remove", ""},
       "--remove: found nothing, expected ids or names" + see("map")},
      {{"bench-set", "v1", "--sets", sets, "--run", "tsdf,tsdf", "--out", "@/o"},
       "method tsdf is named twice"},
      {{"bench-set", "v1", "--sets", sets, "--run", "anchored,tsdf++/anchored", "--out", "@/o"},
       "method tsdf++/anchored is named twice"},
      {{"bench-set", "v1", "--sets", sets, "--leaderboard", "@", "--out", "@/board.json"},
       "--out '@/board.json' would be one of the results of '@', expected another place"},
  };
  EXPECT_GE(wrong.size(), 30U);
  for (const Wrong& one : wrong) {
    std::vector<std::string> words;
    for (const std::string& word : one.words) words.push_back(WithFolder(word, folder.path()));
    const auto output = RunTsdfpp(words, folder.path());
    EXPECT_EQ(output.err, "tsdfpp: " + WithFolder(one.sentence, folder.path()) + "\n");
    EXPECT_EQ(output.exit_code, one.exit_code) << one.sentence;
    EXPECT_EQ(output.out, "") << one.sentence;
    EXPECT_FALSE(fs::exists(folder / "o")) << one.sentence;
  }
}

TEST(Sentences, HelpReadsWell) {
  const test::TempFolder folder;
  const std::string help = RunTsdfpp({"generate", "--help"}, folder.path()).out;
  EXPECT_NE(help.find("--no-antialias  "), std::string::npos) << help;
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"generate"},
                                             {"verify"},
                                             {"export"},
                                             {"map"},
                                             {"compare"},
                                             {"metric", "trajectory"},
                                             {"metric", "surface"},
                                             {"metric", "panoptic"},
                                             {"metric", "pose"}}) {
    std::vector<std::string> words = command;
    words.emplace_back("--help");
    const std::string text = RunTsdfpp(words, folder.path()).out;
    for (const char* odd : {"{false}", "{true}", " in [", "INT:INT", "FLOAT:FLOAT"}) {
      EXPECT_EQ(text.find(odd), std::string::npos) << command.back() << ": " << odd;
    }
  }
}

}  // namespace
}  // namespace tsdfpp
