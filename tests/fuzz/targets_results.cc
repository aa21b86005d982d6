// What our own commands left and later ones read, and COCO's annotations.
#include <CLI/CLI.hpp>
#include <optional>

#include "cli/metric.h"
#include "core/json_text.h"
#include "eval/report/recording.h"
#include "eval/report/report_gates.h"
#include "eval/run/run_folder.h"
#include "eval/sweep/cell.h"
#include "tests/fuzz/complaint.h"
#include "tests/fuzz/file_set.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

namespace fs = std::filesystem;

// record/record.json with record/record.bin.
bool ReadRecord(std::string_view input) {
  auto recording = ReadRecording(WriteSet(input));
  if (!Accepted(recording) || !*recording) return false;
  // As the report's page thins it out.
  for (std::vector<int> frames = (*recording)->KeyFrames(); frames.size() >= 2;) {
    (*recording)->DropKeyFrame((*recording)->LeastKeyFrame({}));
    const std::vector<int> left = (*recording)->KeyFrames();
    Require(left.size() < frames.size(), "a key frame that cannot be dropped");
    frames = left;
  }
  (void)JsonText((*recording)->json);
  return true;
}

// run.json with the files that it lists.
bool ReadRunJson(std::string_view input) {
  const fs::path& folder = WriteSet(input);
  const auto note = ReadRunNote(folder);
  if (!Accepted(note) || !*note) return false;
  std::set<std::string> files{"summary.json"};
  for (const auto& [name, bytes] : (*note)->files) files.insert(name);
  return Accepted(CheckOneRun(folder, (*note)->run, files));
}

bool ReadGatesJson(std::string_view input) {
  const fs::path path = WriteSet(input) / "gates.json";
  const auto gates = ReadGateResults(path);
  if (gates) (void)JsonText(*gates);
  return Accepted(gates, path.string());
}

bool ReadCell(std::string_view input) {
  const Cell cell{{}, "key", "0123456789abcdef", "sequence", {1, 8}, {8}, 8};
  const auto result = CellFromJson(std::string(input), cell);
  if (!Accepted(result, cell.id)) return false;
  const auto again = CellFromJson(JsonText(CellToJson(cell, *result)), cell);
  Require(again.has_value(), again ? "" : "what was written is refused: " + again.error().message);
  return true;
}

// `tsdfpp metric panoptic`, of the encoding that the file "@options" names, else COCO's.
bool ReadCoco(std::string_view input) {
  const fs::path& folder = WriteSet(input);
  std::string encoding = "coco";
  for (const Entry& entry : UnpackSet(input)) {
    if (entry.path == "@options") encoding = entry.bytes;
  }
  CLI::App app;
  const Run run = AddMetricPanoptic(app);
  std::vector<std::string> words{encoding, "--encoding", folder / "pred", folder / "gt"};
  if (encoding == "class-instance") {
    words.insert(words.begin(), {"1,2", "--things", "16", "--divisor"});
  }
  try {
    app.parse(words);  // the last word comes first
  } catch (const CLI::ParseError&) {
    return false;
  }
  const auto result = run();
  if (!Accepted(result)) return false;
  (void)JsonText(result->json);
  return true;
}

}  // namespace

void AddResultTargets(std::vector<Target>& targets) {
  targets.push_back({"recording", "", ReadRecord, {"eval/report/recording.cc"}});
  targets.push_back({"run_note", "", ReadRunJson, {"eval/run/run_folder.cc"}});
  targets.push_back({"gate_results", "", ReadGatesJson, {"eval/report/report_gates.cc"}});
  targets.push_back({"cell", "cell.json", ReadCell, {"eval/sweep/cell.cc"}});
  targets.push_back({"coco",
                     "",
                     ReadCoco,
                     {"eval/score/coco_panoptic.cc", "eval/score/evaluate_panoptic.cc",
                      "eval/score/label_image.cc", "metrics/segmentation.cc"}});
}

}  // namespace tsdfpp::fuzz
