#include "eval/report/report_page.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "core/data_folder.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "eval/report/recording.h"
#include "eval/report/recording_bytes.h"
#include "eval/report/report_gates.h"
#include "eval/run/compare_names.h"
#include "eval/run/run_folder.h"
#include "eval/sweep/sweep_metrics.h"
#include "eval/tools/base64.h"
#include "mapper/method_info.h"
#include "mapper/track/tracker.h"
#include "sequence/sequence_json.h"
#include "viewer/report_template.h"

namespace tsdfpp {
namespace {

using nlohmann::json;

struct Comparison {
  std::filesystem::path folder;
  json summary;
  std::string csv;
  std::optional<Recording> recording;
  json pictures = json::array();
  json files = json::array();
  std::optional<RunNote> note;

  // Whether a file is of the run; of an older version's everything is.
  bool Has(const std::string& name) const { return !note || note->files.contains(name); }
};

// A name for people: the folder's own, even where it is given as "." or with a slash at its end.
std::string NameOf(const std::filesystem::path& folder) { return OwnName(folder); }

// What the page reads of a summary without asking whether it is there.
Expected<void> CheckSummary(const json& summary, const std::filesystem::path& path) {
  if (summary.value("schema", json()) != 1) {
    return DataError("{}: schema is {}, expected 1", path.string(),
                     JsonShown(summary.value("schema", json())));
  }
  for (const char* name : {"sequence", "command", "version", "generator"}) {
    if (!summary.contains(name) || !summary[name].is_string()) {
      return DataError("{}: '{}' is missing or no text", path.string(), name);
    }
  }
  for (const char* name : {"first_frame", "last_frame", "every", "cores", "read_s", "total_s"}) {
    if (!summary.contains(name) || !summary[name].is_number()) {
      return DataError("{}: '{}' is missing or no number", path.string(), name);
    }
  }
  if (!summary.contains("runs") || !summary["runs"].is_array()) {
    return DataError("{}: 'runs' is missing or no list", path.string());
  }
  if (summary["runs"].empty()) {
    return DataError("{}: 'runs' names no map, expected one of ours: adapters' have no page",
                     path.string());
  }
  for (const json& run : summary["runs"]) {
    for (const char* name : {"title", "folder", "method", "profile", "poses"}) {
      if (!run.is_object() || !run.contains(name) || !run[name].is_string()) {
        return DataError("{}: a map's '{}' is missing or no text", path.string(), name);
      }
    }
  }
  return {};
}

// What "figure-close-gt.png" and "table-track.png" are of (eval/compare/pictures.cc).
std::string SettingOf(std::string_view name) {
  name.remove_suffix(std::string_view(".png").size());
  name.remove_prefix(std::min(name.find('-') + 1, name.size()));
  const std::size_t dash = name.rfind('-');
  const auto poses = PoseSourceFromName(name.substr(dash == name.npos ? 0 : dash + 1));
  if (!poses) return std::string(name);
  const std::string profile(dash == name.npos ? "" : name.substr(0, dash));
  return fmt::format("{}{}", profile.empty() ? "" : profile + ", ", PoseSourceTitle(*poses));
}

Expected<void> AddPictures(Comparison& comparison) {
  std::set<std::string> names;
  for (const std::filesystem::path& entry : EntriesOf(comparison.folder)) {
    const std::string name = entry.filename().string();
    if (!name.ends_with(".png") || !comparison.Has(name)) continue;
    // With a recording the page makes the figure itself, sharper and for each frame.
    if (name.starts_with("table-") || (name.starts_with("figure-") && !comparison.recording)) {
      names.insert(name);
    }
  }
  for (const std::string& name : names) {
    TSDFPP_ASSIGN(const std::string bytes, ReadFile(comparison.folder / name));
    comparison.pictures.push_back(
        {{"file", name},
         {"caption", fmt::format("{}; {}",
                                 name.starts_with("table-")
                                     ? "Hidden and kept (blue), hidden and missing (red), visible "
                                       "(light), visible and missing (orange), never seen (grey)"
                                     : "Reconstructions over time and after the removal",
                                 SettingOf(name))},
         {"data", "data:image/png;base64," + Base64(bytes)}});
  }
  return {};
}

Expected<Comparison> ReadComparison(const std::filesystem::path& folder) {
  TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(folder));
  Comparison comparison;
  comparison.folder = folder;
  const std::filesystem::path path = folder / "summary.json";
  if (!IsThere(path)) {
    TSDFPP_ASSIGN(comparison.note, ReadRunNote(folder));
    if (!comparison.note) TSDFPP_RETURN_IF_ERROR(CheckOneRun(folder, std::nullopt, {}));
    return DataError("'{}' has no summary.json, expected a folder that tsdfpp compare wrote",
                     folder.string());
  }
  TSDFPP_ASSIGN(comparison.summary, ReadJsonObject(path));
  TSDFPP_RETURN_IF_ERROR(CheckSummary(comparison.summary, path));
  // Before anything is found wrong that comes of it; the files' sizes when they have been read.
  TSDFPP_RETURN_IF_ERROR(CheckOneRun(folder, RunOfSummary(comparison.summary), {}));
  TSDFPP_ASSIGN(comparison.csv, ReadFile(folder / "frames.csv"));
  if (!comparison.csv.starts_with("frame,method,profile,poses,")) {
    return DataError("{} does not begin with the columns frame,method,profile,poses",
                     (folder / "frames.csv").string());
  }
  TSDFPP_ASSIGN(comparison.recording, ReadRecording(folder));
  TSDFPP_ASSIGN(comparison.note, ReadRunNote(folder));
  TSDFPP_RETURN_IF_ERROR(AddPictures(comparison));
  std::set<std::string> read{kSummaryFile, kFramesFile};
  // Who takes the recording away has a page without it.
  if (comparison.recording) read.insert({"record/record.json", "record/record.bin"});
  for (const json& picture : comparison.pictures) read.insert(picture["file"].get<std::string>());
  TSDFPP_RETURN_IF_ERROR(CheckOneRun(folder, RunOfSummary(comparison.summary), read));
  for (const char* name : {"summary.json", "frames.csv", "record/record.bin"}) {
    const std::filesystem::path file = folder / name;
    if (!IsThere(file)) continue;
    TSDFPP_ASSIGN(const std::string bytes, ReadFile(file));
    comparison.files.push_back(
        {{"name", name}, {"bytes", bytes.size()}, {"hash", HashText(bytes)}});
  }
  // The evaluations are in the CSV as far as the page shows them.
  for (json& run : comparison.summary["runs"]) run.erase("evaluations");
  return comparison;
}

// JSON that can stand inside <script>: no '<' can end it or begin a comment. Bytes that are no
// UTF-8 become U+FFFD.
std::string ScriptText(const json& value) {
  const std::string text = JsonText(value);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string DataText(const std::vector<Comparison>& comparisons, const json& gates,
                     const std::string& command) {
  json reports = json::array();
  std::string blocks;
  for (std::size_t i = 0; i < comparisons.size(); ++i) {
    const Comparison& comparison = comparisons[i];
    json report{{"name", NameOf(comparison.folder)}, {"summary", comparison.summary},
                {"frames_csv", comparison.csv},      {"pictures", comparison.pictures},
                {"files", comparison.files},         {"record", nullptr}};
    if (comparison.recording) {
      report["record"] = comparison.recording->json;
      blocks += fmt::format("<script type=\"text/plain\" id=\"report-bytes-{}\">{}</script>\n", i,
                            Base64(comparison.recording->bytes));
    }
    reports.push_back(std::move(report));
  }
  json colours = json::object();
  for (const MethodInfo& info : Methods()) {
    colours[std::string(info.name)] = {info.on_light, info.on_dark};
  }
  const json data{{"schema", 1},
                  {"colours", std::move(colours)},
                  {"metrics", MetricsJson()},
                  {"version", TSDFPP_VERSION},
                  {"command", command},
                  {"gates", gates},
                  {"reports", std::move(reports)}};
  return "<script type=\"application/json\" id=\"report-data\">" + ScriptText(data) +
         "</script>\n" + blocks;
}

// The frame that a comparison's figures are of: the page begins with it.
int ExaminedFrame(const Comparison& comparison) {
  const json reveal = comparison.summary.value("reveal_frame", json());
  return (reveal.is_number_integer() ? reveal : comparison.summary["last_frame"]).get<int>();
}

// Takes the key frame out that would be missed least, and returns which of whom; nothing where each
// recording has but one. The maps stand side by side at one frame, so it goes everywhere, but for
// the recordings that are examined at it.
std::string DropAKeyFrame(std::vector<Comparison>& comparisons) {
  const auto count = [](const Comparison& comparison) {
    return comparison.recording ? comparison.recording->KeyFrames().size() : 0;
  };
  const auto longest =
      std::max_element(comparisons.begin(), comparisons.end(),
                       [&](const auto& a, const auto& b) { return count(a) < count(b); });
  if (count(*longest) <= 1) return "";
  std::set<int> keep;
  for (Comparison& comparison : comparisons) {
    keep.insert(ExaminedFrame(comparison));
    if (comparison.recording) keep.insert(comparison.recording->KeyFrames().back());
  }
  int frame = longest->recording->LeastKeyFrame(keep);
  if (keep.contains(frame)) frame = longest->recording->LeastKeyFrame({ExaminedFrame(*longest)});
  std::vector<std::string> dropped;
  for (Comparison& comparison : comparisons) {
    if (count(comparison) <= 1 || ExaminedFrame(comparison) == frame) continue;
    const std::size_t before = count(comparison);
    comparison.recording->DropKeyFrame(frame);
    if (count(comparison) < before) dropped.push_back(NameOf(comparison.folder));
  }
  return fmt::format("key frame {} of {} is left out", frame, fmt::join(dropped, " and "));
}

}  // namespace

Expected<ReportPage> MakeReportPage(const std::vector<std::filesystem::path>& folders,
                                    const std::string& command, std::size_t largest_bytes,
                                    const std::filesystem::path& gates) {
  const std::string_view page = ReportTemplate();
  const std::size_t mark = page.find(kReportDataMark);
  if (mark == std::string_view::npos) {
    return EnvironmentError(
        "this build has no report page, which needs Node.js: run scripts/setup.sh and build again");
  }
  std::vector<Comparison> comparisons;
  for (const std::filesystem::path& folder : folders) {
    TSDFPP_ASSIGN(Comparison comparison, ReadComparison(folder));
    comparisons.push_back(std::move(comparison));
  }
  json verdicts;
  if (!gates.empty()) {
    TSDFPP_ASSIGN(verdicts, ReadGateResults(gates));
  }
  ReportPage made;
  while (true) {
    const std::string data = DataText(comparisons, verdicts, command);
    if (page.size() + data.size() <= largest_bytes) {
      made.html = std::string(page.substr(0, mark)) + data +
                  std::string(page.substr(mark + kReportDataMark.size()));
      break;
    }
    const std::string remark = DropAKeyFrame(comparisons);
    if (remark.empty()) {
      return DataError("the report would have {} bytes, expected at most {}",
                       page.size() + data.size(), largest_bytes);
    }
    made.remarks.push_back(
        fmt::format("{} to stay below {} MB", remark, largest_bytes / 1'000'000));
  }
  for (const Comparison& comparison : comparisons) {
    if (!comparison.recording) continue;
    TSDFPP_RETURN_IF_ERROR(CheckRecordedBytes(
        *comparison.recording, (comparison.folder / "record" / "record.bin").string()));
  }
  return made;
}

}  // namespace tsdfpp
