// A comparison's files, and that disk, repetition and threads change no byte of what it makes.
#include "eval/compare/compare.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>

#include "core/files.h"
#include "core/ply.h"
#include "eval/compare/compare_report.h"
#include "eval/run/open_source.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using test::RunTsdfpp;
using test::TempFolder;

const char* const kMini = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
constexpr int kRevealFrame = 40;
const std::vector<Method> kMethods{Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored};
const std::vector<std::string> kMethodNames{"tsdf", "tsdf++", "tsdf++/anchored"};
const std::vector<std::string> kFolders{"tsdf_close_gt", "tsdf++_close_gt",
                                        "tsdf++-anchored_close_gt"};

CompareConfig CloseConfig(int every, std::string until) {
  CompareConfig config;
  config.methods = kMethods;
  config.profiles = {"close"};
  config.every = every;
  config.until = std::move(until);
  return config;
}

std::string BytesOf(const std::filesystem::path& file) {
  const auto bytes = ReadFile(file);
  EXPECT_TRUE(bytes.has_value()) << file;
  return bytes.value_or("");
}

// Paths of all files below `folder`, relative to it.
std::set<std::string> FilesBelow(const std::filesystem::path& folder) {
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.insert(entry.path().lexically_relative(folder).string());
  }
  return files;
}

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

// frames.csv as rows of cells, without the columns that hold times (their names end with _s).
std::vector<std::vector<std::string>> RowsWithoutTimes(const std::filesystem::path& out) {
  const std::vector<std::string> lines = Split(BytesOf(out / "frames.csv"), '\n');
  std::vector<std::vector<std::string>> rows;
  if (lines.empty()) return rows;
  const std::vector<std::string> titles = Split(lines.front(), ',');
  for (const std::string& line : lines) {
    const std::vector<std::string> cells = Split(line, ',');
    EXPECT_EQ(cells.size(), titles.size()) << line;
    rows.emplace_back();
    for (std::size_t c = 0; c < std::min(cells.size(), titles.size()); ++c) {
      if (!titles[c].ends_with("_s")) rows.back().push_back(cells[c]);
    }
  }
  return rows;
}

// An undefined figure is {"value": null, "why": "..."}; a null alone would be a number that was not
// finite.
int CountUndefined(const nlohmann::json& node, const std::string& where) {
  int count = 0;
  if (node.is_object() && node.contains("why")) {
    EXPECT_TRUE(node.at("value").is_null()) << where;
    EXPECT_FALSE(node.at("why").get<std::string>().empty()) << where;
    return 1;
  }
  EXPECT_FALSE(node.is_null()) << where << " is null without a reason";
  if (node.is_structured()) {
    for (const auto& [key, value] : node.items()) {
      count += CountUndefined(value, where + "/" + key);
    }
  }
  return count;
}

void ExpectSummary(const std::filesystem::path& out) {
  const auto summary = nlohmann::json::parse(BytesOf(out / "summary.json"), nullptr, false);
  ASSERT_FALSE(summary.is_discarded());
  EXPECT_EQ(summary.at("schema"), 1);
  EXPECT_EQ(summary.at("command"), "the command");
  EXPECT_EQ(summary.at("sequence"), "mini");
  EXPECT_EQ(summary.at("first_frame"), 1);
  EXPECT_EQ(summary.at("last_frame"), kRevealFrame);
  EXPECT_EQ(summary.at("reveal_frame"), kRevealFrame);
  EXPECT_EQ(summary.at("removed"), nlohmann::json({1}));
  ASSERT_EQ(summary.at("runs").size(), kMethods.size());
  for (std::size_t r = 0; r < kMethods.size(); ++r) {
    const nlohmann::json& run = summary.at("runs")[r];
    EXPECT_EQ(run.at("method"), kMethodNames[r]);
    EXPECT_EQ(run.at("folder"), kFolders[r]);
    EXPECT_EQ(run.at("profile"), "close");
    EXPECT_EQ(run.at("poses"), "gt");
    EXPECT_EQ(run.at("settings").at("trunc_back_voxels"), 3);
    EXPECT_GT(run.at("map").at("bytes").get<double>(), 0);
    for (const char* step : {"track", "update_poses", "fuse", "mesh_scene"}) {
      const nlohmann::json& times = run.at("times").at(step);
      EXPECT_LE(times.at("median_ms").get<double>(), times.at("p99_ms").get<double>()) << step;
      EXPECT_LE(times.at("p99_ms").get<double>(), times.at("worst_ms").get<double>()) << step;
    }
    EXPECT_EQ(run.at("difference_to_tsdf").contains("why"), kMethods[r] == Method::kTsdf);
    // Frames 25 (every 25th) and 40 (the reveal).
    const nlohmann::json& evaluations = run.at("evaluations");
    ASSERT_EQ(evaluations.size(), 2U);
    EXPECT_EQ(evaluations[0].at("frame"), 25);
    EXPECT_EQ(evaluations[1].at("frame"), kRevealFrame);
    EXPECT_EQ(run.at("examined"), evaluations[1]);
    for (const nlohmann::json& evaluation : evaluations) {
      EXPECT_EQ(evaluation.at("objects").size(), 3U);
      EXPECT_GE(CountUndefined(evaluation, run.at("folder").get<std::string>()), 0);
    }
    // At the first evaluation nothing was seen by an earlier one, so nothing can be retained.
    EXPECT_GT(CountUndefined(evaluations[0], "first"), 0);
  }
}

void ExpectReport(const std::filesystem::path& out) {
  const std::string html = BytesOf(out / "report.html");
  EXPECT_TRUE(html.starts_with("<!doctype html>"));
  EXPECT_TRUE(html.ends_with("</html>\n"));
  // Self-contained: nothing to fetch, from the net or from beside it.
  for (const char* reference : {"http:", "https:", "<link", "<script src", "@import", "url("}) {
    EXPECT_EQ(html.find(reference), std::string::npos) << reference;
  }
  std::size_t images = 0;
  for (std::size_t at = html.find("src=\""); at != std::string::npos;
       at = html.find("src=\"", at + 1)) {
    EXPECT_EQ(html.compare(at + 5, 22, "data:image/png;base64,"), 0);
    ++images;
  }
  EXPECT_EQ(images, 2U);  // the figure and the table from above
  for (const std::string& name : kMethodNames) EXPECT_NE(html.find(name), std::string::npos);
}

TEST(Compare, WritesItsFilesAndEqualsTheWayOverDisk) {
  const TempFolder folder;
  auto source = OpenSource(kMini);
  ASSERT_TRUE(source.has_value()) << source.error().message;
  const std::filesystem::path out = folder / "compare";
  int progress = 0;
  const auto result =
      RunCompare(**source, CloseConfig(25, "reveal"), out, "the command", [&](int done, int total) {
        EXPECT_EQ(done, ++progress);
        EXPECT_EQ(total, kRevealFrame);
      });
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(progress, kRevealFrame);

  ExpectSummary(out);
  ExpectReport(out);
  const auto rows = RowsWithoutTimes(out);
  ASSERT_EQ(rows.size(), 1 + 2 * kMethods.size());
  for (std::size_t r = 0; r < kMethods.size(); ++r) {
    EXPECT_EQ(rows[1 + 2 * r][0], "25");
    EXPECT_EQ(rows[2 + 2 * r][0], "40");
    EXPECT_EQ(rows[1 + 2 * r][1], kMethodNames[r]);
  }
  std::set<std::string> expected{"frames.csv",          "report.html", "summary.json",
                                 "figure-close-gt.png", "table.txt",   "run.json"};
  for (const std::string& run : kFolders) {
    for (const char* file : {"mesh/background-0.ply", "mesh/house-2.ply", "mesh/scene.ply",
                             "trajectories/car-1.txt", "trajectories/house-2.txt"}) {
      expected.insert(run + "/" + file);
    }
  }
  std::set<std::string> files = FilesBelow(out);
  std::erase_if(files, [](const std::string& file) { return file.starts_with("table-"); });
  EXPECT_EQ(files, expected);
  EXPECT_FALSE(cv::imread((out / "figure-close-gt.png").string()).empty());

  // The same frames over the disk, through the command.
  const std::string sequence = folder / "mini";
  auto command = RunTsdfpp({"generate", kMini, "--out", sequence}, folder.path());
  ASSERT_EQ(command.exit_code, 0) << command.err;
  for (std::size_t r = 0; r < kMethods.size(); ++r) {
    const std::filesystem::path map = folder / ("map" + std::to_string(r));
    command =
        RunTsdfpp({"map", sequence, "--until", std::to_string(kRevealFrame), "--remove", "car",
                   "--method", kMethodNames[r], "--profile", "close", "--out", map.string()},
                  folder.path());
    ASSERT_EQ(command.exit_code, 0) << command.err;
    std::set<std::string> of_map = FilesBelow(map);
    EXPECT_EQ(of_map.erase("stats.json"), 1U);
    EXPECT_EQ(of_map.erase("run.json"), 1U);
    EXPECT_EQ(of_map, FilesBelow(out / kFolders[r]));
    for (const std::string& file : of_map) {
      EXPECT_TRUE(BytesOf(map / file) == BytesOf(out / kFolders[r] / file))
          << kFolders[r] << ": " << file << " differs between streamed frames and frames on disk";
    }
    // The removed car is in no mesh; the rest is.
    const auto scene = ReadPly(map / "mesh" / "scene.ply");
    ASSERT_TRUE(scene.has_value());
    const std::set<InstanceId> ids(scene->face_ids.begin(), scene->face_ids.end());
    EXPECT_EQ(ids, (std::set<InstanceId>{0, 2}));
  }
}

TEST(Compare, TwiceTheSameWhateverTheThreads) {
  const TempFolder folder;
  const auto compare = [&](std::size_t threads, const std::string& name) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    auto source = OpenSource(kMini);
    ASSERT_TRUE(source.has_value()) << source.error().message;
    const auto result = RunCompare(**source, CloseConfig(4, "8"), folder / name, "the command", {});
    ASSERT_TRUE(result.has_value()) << result.error().message;
  };
  compare(2, "first");
  compare(2, "again");
  compare(1, "one");
  compare(4, "four");
  const auto rows = RowsWithoutTimes(folder / "first");
  EXPECT_EQ(rows.size(), 1 + 2 * kMethods.size());
  const std::set<std::string> files = FilesBelow(folder / "first");
  for (const char* other : {"again", "one", "four"}) {
    EXPECT_EQ(RowsWithoutTimes(folder / other), rows) << other;
    ASSERT_EQ(FilesBelow(folder / other), files) << other;
    for (const std::string& file : files) {
      // Meshes, trajectories, pictures and the table; the rest holds times or the run's name.
      if (file == "run.json" || file == "frames.csv" || file == "summary.json" ||
          file == "report.html")
        continue;
      EXPECT_TRUE(BytesOf(folder / other / file) == BytesOf(folder / "first" / file))
          << other << ": " << file;
    }
  }
}

TEST(Compare, CommandsThreadsChangeNoByte) {
  const TempFolder folder;
  for (const std::string& method : kMethodNames) {
    std::map<std::string, std::string> first;
    for (const char* threads : {"1", "2", "4"}) {
      const std::filesystem::path out = folder / "map";
      std::filesystem::remove_all(out);
      const auto command = RunTsdfpp({"map", kMini, "--until", "8", "--method", method, "--threads",
                                      threads, "--out", out.string()},
                                     folder.path());
      ASSERT_EQ(command.exit_code, 0) << command.err;
      std::map<std::string, std::string> bytes;
      for (const std::string& file : FilesBelow(out)) {
        if (file != "stats.json" && file != "run.json") bytes[file] = BytesOf(out / file);
      }
      if (first.empty()) first = bytes;
      EXPECT_GE(bytes.size(), 4U);
      EXPECT_TRUE(bytes == first) << method << " with " << threads << " threads";
    }
  }
}

TEST(Compare, RefusesAStopThatIsNoFrame) {
  const TempFolder folder;
  auto source = OpenSource(kMini);
  ASSERT_TRUE(source.has_value()) << source.error().message;
  for (const char* until : {"0", "49", "soon", "7th", ""}) {
    const auto result =
        RunCompare(**source, CloseConfig(7, until), folder / "out", "the command", {});
    ASSERT_FALSE(result.has_value()) << until;
    EXPECT_EQ(result.error().kind, ErrorKind::kUsage) << until;
    EXPECT_NE(result.error().message.find("--until"), std::string::npos) << until;
    EXPECT_FALSE(std::filesystem::exists(folder / "out")) << until;
  }
  const auto result =
      RunCompare(**source, CloseConfig(0, "reveal"), folder / "out", "the command", {});
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
}

}  // namespace
}  // namespace tsdfpp
