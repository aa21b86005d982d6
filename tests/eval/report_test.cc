// The page made of a comparison and its recording: sizes, places, and that nothing in a run can act
// in it.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "core/files.h"
#include "eval/report/recording.h"
#include "eval/report/report_page.h"
#include "eval/report/report_video.h"
#include "eval/sweep/sweep_metrics.h"
#include "eval/tools/base64.h"
#include "mapper/method_info.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"
#include "viewer/report_template.h"

namespace tsdfpp {
namespace {

using nlohmann::json;
using test::TempFolder;

// What `tsdfpp compare --record` could have written, of two key frames whose bytes are no images.
void WriteTinyRun(const std::filesystem::path& folder) {
  const json run{{"title", "tsdf, paper, given poses"},
                 {"folder", "tsdf_paper_gt"},
                 {"method", "tsdf"},
                 {"profile", "paper"},
                 {"poses", "gt"}};
  const json summary{{"schema", 1},
                     {"generator", "tsdfpp"},
                     {"version", "0.1.0"},
                     {"command", "c"},
                     {"sequence", "tiny"},
                     {"first_frame", 1},
                     {"last_frame", 16},
                     {"every", 8},
                     {"cores", 2},
                     {"read_s", 1.5},
                     {"total_s", 2.5},
                     {"removed", {1}},
                     {"reveal_frame", nullptr},
                     {"runs", {run}}};
  ASSERT_TRUE(WriteFile(folder / "summary.json", summary.dump()));
  ASSERT_TRUE(
      WriteFile(folder / "frames.csv", "frame,method,profile,poses,x\n8,tsdf,paper,gt,1\n"));
  std::string bytes;
  const auto place = [&](std::size_t length) {
    json at = json::array({bytes.size(), length});
    for (std::size_t i = 0; i < length; ++i) bytes += static_cast<char>(bytes.size() * 37 % 251);
    return at;
  };
  const auto mesh = [&](const char* layer) {
    return json{{"id", 0U},
                {"vertices", 3U},
                {"triangles", 1U},
                {"layer", layer},
                {"vertex_bytes", place(90)},
                {"index_bytes", place(10)}};
  };
  json keys = json::array();
  json run_keys = json::array();
  json frames = json::array();
  for (const int frame : {8, 16}) {
    frames.push_back({{"frame", frame}, {"T_WC", {0, 0, 0, 0, 0, 0, 1}}, {"T_WO", json::object()}});
    keys.push_back(
        {{"frame", frame}, {"colour", place(3000)}, {"depth", place(2000)}, {"mask", place(500)}});
    run_keys.push_back({{"frame", frame},
                        {"picture", place(4000)},
                        {"picture_after", place(4000)},
                        {"chunks", {mesh("common"), mesh("hole")}}});
  }
  const json record{{"schema", 1},
                    {"grid", {{"origin_m", {0, 0, 0}}, {"step_m", 0.001}}},
                    {"intrinsics", json::object()},
                    {"error_step_m", 0.0002},
                    {"age_step_frames", 1},
                    {"depth_range_m", {0.5, 3}},
                    {"objects", {{{"id", 0U}, {"name", "background"}, {"colour", {1, 2, 3}}}}},
                    {"frames", frames},
                    {"truth", {mesh("truth")}},
                    {"key_frames", keys},
                    {"runs", {{{"folder", "tsdf_paper_gt"}, {"key_frames", run_keys}}}}};
  ASSERT_TRUE(WriteFile(folder / "record" / "record.json", record.dump()));
  ASSERT_TRUE(WriteFile(folder / "record" / "record.bin", bytes));
}

std::string Text(const std::filesystem::path& file) { return ReadFile(file).value_or(""); }

class Report : public testing::Test {
 protected:
  void SetUp() override { WriteTinyRun(Run()); }
  std::filesystem::path Run() const { return folder_ / "run"; }
  std::filesystem::path Copy(const std::string& name) const {
    std::filesystem::path copy = folder_ / name;
    std::filesystem::copy(Run(), copy, std::filesystem::copy_options::recursive);
    return copy;
  }

 private:
  TempFolder folder_;
};

// A cache of the compiler's may know the page by its path alone.
TEST(ReportTemplate, IsThePageThatWasBundledLast) {
  const auto bundled =
      ReadFile(std::filesystem::path(TSDFPP_COMMAND).parent_path() / "viewer" / "report.html");
  ASSERT_TRUE(bundled.has_value()) << bundled.error().message;
  EXPECT_TRUE(ReportTemplate() == *bundled);
}

TEST_F(Report, MakesAPageWithItsFiguresAndNoPlaceLeft) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const auto page = MakeReportPage({Run(), Copy("second")}, "tsdfpp report run");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_LT(page->html.size(), kLargestPage_bytes);
  EXPECT_EQ(page->html.find(kReportDataMark), std::string::npos);
  EXPECT_NE(page->html.find("id=\"report-bytes-1\""), std::string::npos);
  EXPECT_EQ(page->html.find("http-equiv=\"refresh\""), std::string::npos);
}

// The data of a page, as its script reads them.
json DataOf(const std::string& html) {
  const std::string begin = "<script type=\"application/json\" id=\"report-data\">";
  const std::size_t at = html.find(begin) + begin.size();
  return json::parse(html.substr(at, html.find("</script>", at) - at));
}

// What a metric is called, its unit and its direction the page has from the one table.
TEST_F(Report, ThePageHasTheTableOfMetrics) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const auto page = MakeReportPage({Run()}, "c");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_EQ(DataOf(page->html)["metrics"], MetricsJson());
}

// The strings of a list in JavaScript: const kName = ['a', 'b'];
std::vector<std::string> QuotedIn(const std::string& script, const std::string& list) {
  const std::size_t begin = script.find("const " + list + " = [");
  if (begin == std::string::npos) return {};
  const std::string items = script.substr(begin, script.find(']', begin) - begin);
  const std::regex quoted("'([^']+)'");
  std::vector<std::string> names;
  for (std::sregex_iterator it(items.begin(), items.end(), quoted), end; it != end; ++it) {
    names.push_back((*it)[1]);
  }
  return names;
}

// Which metrics and methods it shows first a page chooses; what they are it reads.
TEST(ReportPage, NamesOnlyWhatTheTablesHave) {
  const std::filesystem::path sources = TSDFPP_SOURCE_DIR "/viewer/src";
  const std::string measures = ReadFile(sources / "measures.js").value();
  for (const SweepMetric& metric : SweepMetrics()) {
    EXPECT_EQ(measures.find(metric.name), std::string::npos) << metric.name << " is typed again";
  }
  const std::string top = ReadFile(sources / "summary.js").value();
  std::vector<std::string> metrics = QuotedIn(top, "kNumbers");
  EXPECT_EQ(metrics.size(), 3U);
  const std::vector<std::string> plotted =
      QuotedIn(ReadFile(sources / "plots.js").value(), "kFromCsv");
  EXPECT_GT(plotted.size(), 3U);
  metrics.insert(metrics.end(), plotted.begin(), plotted.end());
  for (const std::string& name : metrics) EXPECT_NE(FindMetric(name), nullptr) << name;
  const std::vector<std::string> heroes = QuotedIn(top, "kHeroes");
  EXPECT_GT(heroes.size(), 1U);
  for (const std::string& name : heroes) EXPECT_TRUE(MethodFromName(name)) << name;
}

// Key frames go, one at a time, and with them their bytes, until the page is small enough.
TEST_F(Report, APageThatIsTooLargeLeavesOutKeyFramesAndSaysSo) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const auto whole = MakeReportPage({Run()}, "c");
  ASSERT_TRUE(whole.has_value());
  const auto page = MakeReportPage({Run()}, "c", whole->html.size() - 1000);
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_LT(page->html.size(), whole->html.size() - 1000);
  ASSERT_EQ(page->remarks.size(), 1U);
  EXPECT_NE(page->remarks[0].find("key frame 8 "), std::string::npos) << page->remarks[0];
  const auto none = MakeReportPage({Run()}, "c", 1000);
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().kind, ErrorKind::kData);
}

TEST_F(Report, DroppingAKeyFrameKeepsTheBytesOfTheOthers) {
  Recording record = **ReadRecording(Run());
  const auto bytes_of = [&](const json& place) {
    return record.bytes.substr(place[0].get<std::size_t>(), place[1].get<std::size_t>());
  };
  const std::string colour = bytes_of(record.json["key_frames"][1]["colour"]);
  const std::string picture = bytes_of(record.json["runs"][0]["key_frames"][1]["picture"]);
  const std::size_t before = record.bytes.size();
  EXPECT_EQ(record.LeastKeyFrame({}), 8);
  EXPECT_EQ(record.LeastKeyFrame({8}), 16);
  EXPECT_EQ(record.LeastKeyFrame({8, 16}), 16);
  record.DropKeyFrame(9);  // which there is not
  EXPECT_EQ(record.bytes.size(), before);
  record.DropKeyFrame(8);
  EXPECT_LT(record.bytes.size(), before * 3 / 4);
  EXPECT_EQ(record.KeyFrames(), std::vector<int>{16});
  EXPECT_EQ(bytes_of(record.json["key_frames"][0]["colour"]), colour);
  EXPECT_EQ(bytes_of(record.json["runs"][0]["key_frames"][0]["picture"]), picture);
}

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
}

// A name can say what it likes: between its <script> tags the data has no '<' at all.
TEST_F(Report, NothingInARunCanEndTheDataOfThePage) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const std::filesystem::path copy = Copy("<script>bad()<!--");
  json summary = json::parse(Text(copy / "summary.json"));
  summary["sequence"] = "</script><script>alert(1)</script><!--<script>";
  summary["runs"][0]["title"] = "\xff<img src=x onerror=alert(1)>";
  ASSERT_TRUE(WriteFile(copy / "summary.json",
                        summary.dump(1, ' ', false, json::error_handler_t::replace)));
  const auto page = MakeReportPage({copy}, "tsdfpp report '</script>'");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  const std::string open = "id=\"report-data\">";
  const std::size_t start = page->html.find(open) + open.size();
  const std::size_t end = page->html.find('<', start);
  EXPECT_EQ(page->html.compare(end, 9, "</script>"), 0);
  const json data = json::parse(page->html.substr(start, end - start), nullptr, false);
  ASSERT_TRUE(data.is_object()) << "the data ended early";
  EXPECT_EQ(data["reports"][0]["summary"]["sequence"], summary["sequence"]);
}

// What another run left there is not shown beside this one's.
TEST_F(Report, AnInterruptedRunGetsASentence) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const auto expect = [&](const std::filesystem::path& run, const std::string& words) {
    const auto page = MakeReportPage({run}, "c");
    ASSERT_FALSE(page.has_value()) << words;
    EXPECT_EQ(page.error().kind, ErrorKind::kData);
    EXPECT_NE(page.error().message.find("holds an interrupted run"), std::string::npos)
        << page.error().message;
    EXPECT_NE(page.error().message.find(words), std::string::npos) << page.error().message;
  };
  const std::filesystem::path run = Copy("named");
  json summary = json::parse(Text(run / "summary.json"));
  summary["run"] = "0123456789abcdef";
  const std::string text = summary.dump();
  ASSERT_TRUE(WriteFile(run / "summary.json", text));
  expect(run, "its run.json is missing");
  EXPECT_FALSE(WriteReportVideo(run, run / "film.mp4").has_value());
  json note{{"schema", 1}, {"command", "c"}, {"run", "0123456789abcdef"}, {"files", json::array()}};
  for (const char* file :
       {"summary.json", "frames.csv", "record/record.json", "record/record.bin"}) {
    note["files"].push_back({{"name", file}, {"bytes", Text(run / file).size()}});
  }
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  // A picture that the run does not know is left out; of an older version's run all are taken.
  ASSERT_TRUE(WriteFile(run / "table-gt.png", "another run's"));
  const auto page = MakeReportPage({run}, "c");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_EQ(page->html.find(Base64("another run's")), std::string::npos);

  ASSERT_TRUE(WriteFile(run / "frames.csv", Text(run / "frames.csv") + "\n"));
  expect(run, "frames.csv has");
  note["run"] = "fedcba9876543210";
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  expect(run, "its summary is of another run");
  note["files"][0]["name"] = "../summary.json";
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  const auto odd = MakeReportPage({run}, "c");
  ASSERT_FALSE(odd.has_value());
  EXPECT_NE(odd.error().message.find("a file lies elsewhere"), std::string::npos);
  // An older recording beside a comparison that made none.
  note["run"] = "0123456789abcdef";
  note["files"] = json::array();
  for (const char* file : {"summary.json", "frames.csv"}) {
    note["files"].push_back({{"name", file}, {"bytes", nullptr}});
  }
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  expect(run, "record/record.bin is not of this run");
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
