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
#include "tests/eval/tiny_run.h"
#include "tests/needs.h"
#include "viewer/report_template.h"

namespace tsdfpp {
namespace {

using nlohmann::json;
using test::Report;
using test::Text;
using test::WriteTinyRun;

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

// Of a run that is examined at its last frame, beside a longer one with more bytes to give up.
TEST_F(Report, TheExaminedFrameOfEachRunStays) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const std::filesystem::path shorter = Run();
  const std::filesystem::path longer = Run().parent_path() / "longer";
  WriteTinyRun(longer, {8, 16, 24, 32, 40});
  const auto frames_of = [](const json& report) {
    std::vector<int> frames;
    for (const json& key : report["record"]["key_frames"]) frames.push_back(key["frame"]);
    return frames;
  };
  const auto whole = MakeReportPage({longer, shorter}, "c");
  ASSERT_TRUE(whole.has_value()) << whole.error().message;
  constexpr std::size_t kOfAKeyFrame_bytes = 14000;  // in base 64 they are more
  std::size_t most = whole->html.size();
  for (int left_out = 1; left_out <= 6; ++left_out) {
    most -= kOfAKeyFrame_bytes;
    const auto page = MakeReportPage({longer, shorter}, "c", most);
    ASSERT_TRUE(page.has_value()) << left_out << ": " << page.error().message;
    const json reports = DataOf(page->html)["reports"];
    EXPECT_EQ(frames_of(reports[0]).back(), 40) << left_out;
    EXPECT_EQ(frames_of(reports[1]).back(), 16) << left_out;
    // A remark names the runs that lost the frame, and no other.
    for (const std::string& remark : page->remarks) {
      const int frame = std::stoi(remark.substr(std::string("key frame ").size()));
      for (const std::size_t r : {0U, 1U}) {
        const std::vector<int> kept = frames_of(reports[r]);
        const bool is_gone = std::find(kept.begin(), kept.end(), frame) == kept.end();
        const bool is_named =
            remark.find(reports[r]["name"].get<std::string>()) != std::string::npos;
        const bool was_there = r == 0 || frame <= 16;
        EXPECT_EQ(is_named, is_gone && was_there) << remark;
      }
    }
  }
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

}  // namespace
}  // namespace tsdfpp
