// Comparisons and recordings of which no page or film can be made.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/files.h"
#include "eval/report/recording.h"
#include "eval/report/report_page.h"
#include "eval/report/report_video.h"
#include "tests/eval/tiny_run.h"
#include "tests/needs.h"
#include "viewer/report_template.h"

namespace tsdfpp {
namespace {

using nlohmann::json;
using test::Report;
using test::Text;

// Numbers that wrap would never be dropped; bytes that are named over and over fill all memory.
TEST_F(Report, ARecordingNamesItsFramesAndBytesOnce) {
  const auto refused = [&](const std::string& name, const std::function<void(json&)>& spoil) {
    const std::filesystem::path run = Copy(name);
    json record = json::parse(Text(run / "record" / "record.json"));
    spoil(record);
    EXPECT_TRUE(WriteFile(run / "record" / "record.json", record.dump()));
    const auto recording = ReadRecording(run);
    return recording ? std::string() : recording.error().message;
  };
  const auto wrapped = [](json& record) { record["key_frames"][0]["frame"] = 4294967304; };
  EXPECT_NE(refused("wrapped", wrapped).find("lacks something"), std::string::npos);
  const auto negative = [](json& record) { record["frames"][0]["frame"] = -1; };
  EXPECT_NE(refused("negative", negative).find("lacks something"), std::string::npos);
  const auto twice = [&](json& record) {
    record["key_frames"][0]["colour"] = {0, Text(Run() / "record" / "record.bin").size()};
  };
  EXPECT_NE(refused("twice", twice).find("is no offset and length of its own"), std::string::npos);
  EXPECT_EQ(refused("sound", [](json&) {}), "");
  const auto unknown = [](json& record) { record["runs"][0]["position_error_mm"]["3"] = nullptr; };
  EXPECT_EQ(refused("unknown", unknown), "");
}

// A page or film would show whatever a link leads to.
TEST_F(Report, LinksOutOfTheRunAreNotFollowed) {
  const std::filesystem::path outside = Run().parent_path() / "secret.webp";
  ASSERT_TRUE(WriteFile(outside, "secret"));
  const std::filesystem::path still = Copy("still");
  std::filesystem::create_directories(still / "record" / "stills");
  std::filesystem::create_symlink(outside, still / "record" / "stills" / "colour-000008.webp");
  const std::filesystem::path record = Copy("record");
  std::filesystem::remove_all(record / "record");
  std::filesystem::create_directory_symlink(Run() / "record", record / "record");
  for (const std::filesystem::path& run : {still, record}) {
    const auto film = WriteReportVideo(run, run / "film.mp4");
    ASSERT_FALSE(film.has_value()) << run;
    EXPECT_EQ(film.error().kind, ErrorKind::kData);
    EXPECT_NE(film.error().message.find("leads by a link to"), std::string::npos)
        << film.error().message;
    EXPECT_FALSE(std::filesystem::exists(run / "film.mp4"));
  }
}

TEST_F(Report, SpoiltFilesGetASentence) {
  struct Case {
    const char* name;
    std::function<void(const std::filesystem::path&)> spoil;
    const char* says;
  };
  const auto edit = [](const std::filesystem::path& file,
                       const std::function<void(json&)>& change) {
    json value = json::parse(Text(file));
    change(value);
    ASSERT_TRUE(WriteFile(file, value.dump()));
  };
  const std::vector<Case> cases{
      {"no-summary", [](const auto& run) { std::filesystem::remove(run / "summary.json"); },
       "has no summary.json"},
      {"no-json", [](const auto& run) { (void)WriteFile(run / "summary.json", "[1"); },
       "not a JSON object"},
      {"schema",
       [&](const auto& run) { edit(run / "summary.json", [](json& s) { s["schema"] = 7; }); },
       "schema is 7, expected 1"},
      {"no-runs",
       [&](const auto& run) { edit(run / "summary.json", [](json& s) { s["runs"] = 1; }); },
       "'runs' is missing"},
      {"adapters-alone",
       [&](const auto& run) {
         edit(run / "summary.json", [](json& s) { s["runs"] = json::array(); });
       },
       "'runs' names no map, expected one of ours"},
      {"no-csv", [](const auto& run) { std::filesystem::remove(run / "frames.csv"); },
       "frames.csv"},
      {"csv", [](const auto& run) { (void)WriteFile(run / "frames.csv", "a,b\n"); },
       "does not begin with"},
      {"short-bytes",
       [](const auto& run) { std::filesystem::resize_file(run / "record" / "record.bin", 1000); },
       "in the 1000 bytes of record.bin"},
      {"no-bytes", [](const auto& run) { std::filesystem::remove(run / "record" / "record.bin"); },
       "record.bin"},
      {"place",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) {
           r["key_frames"][0]["mask"] = {-1, 5};
         });
       },
       "[-1,5] is no offset and length"},
      {"pose",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["frames"][0]["T_WC"] = {1, 2}; });
       },
       "lacks something"},
      {"chunks",
       [&](const auto& run) {
         edit(run / "record" / "record.json",
              [](json& r) { r["runs"][0]["key_frames"][0]["chunks"] = "all"; });
       },
       "lacks something"},
      {"grid",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["grid"] = "x"; });
       },
       "'grid' is \"x\", expected origin_m"},
      {"grid-of-a-mesh",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["truth"][0]["grid"] = nullptr; });
       },
       "lacks something"},
      {"intrinsics",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["intrinsics"] = nullptr; });
       },
       "'intrinsics' is null, expected width"},
      {"focal-length",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["intrinsics"]["fy"] = 0; });
       },
       "fx and fy, not 0"},
      {"key-frame",
       [&](const auto& run) {
         edit(run / "record" / "record.json",
              [](json& r) { r["runs"][0]["key_frames"][1]["frame"] = 9; });
       },
       "map 'tsdf_paper_gt' has key frame 9, expected one"},
      {"key-frame-twice",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["key_frames"][1]["frame"] = 8; });
       },
       "'key_frames' has frame 8 after 8"},
      {"times",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["runs"][0].erase("fuse_ms"); });
       },
       "no list of numbers 'fuse_ms'"},
      {"errors",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) {
           r["runs"][0]["position_error_mm"]["3"] = {{1, 2, 3}};
         });
       },
       "pairs of numbers by object"},
      {"pose-of-an-object",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) {
           r["frames"][0]["T_WO"]["3"] = {1, 2};
         });
       },
       "lacks something"},
      {"picture-is-a-mesh",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) {
           std::swap(r["runs"][0]["key_frames"][0]["picture_after"],
                     r["runs"][0]["key_frames"][0]["chunks"][0]["vertex_bytes"]);
         });
       },
       "key frame 8 of map 'tsdf_paper_gt': 'picture_after' is no WebP image"},
      {"vast-mesh",
       [&](const auto& run) {
         edit(run / "record" / "record.json",
              [](json& r) { r["truth"][0]["vertices"] = 4000000000U; });
       },
       "the truth: mesh 0 cannot be unpacked"},
      {"zeros",
       [](const auto& run) {
         const std::filesystem::path bytes = run / "record" / "record.bin";
         (void)WriteFile(bytes, std::string(std::filesystem::file_size(bytes), '\0'));
       },
       "record.bin: the truth: mesh 0 cannot be unpacked"},
  };
  for (const Case& each : cases) {
    const std::filesystem::path run = Copy(each.name);
    each.spoil(run);
    const auto page = MakeReportPage({run}, "c");
    TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
    ASSERT_FALSE(page.has_value()) << each.name;
    EXPECT_EQ(page.error().kind, ErrorKind::kData) << each.name;
    EXPECT_NE(page.error().message.find(each.says), std::string::npos) << page.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
