#include "eval/compare/compare_report.h"

#include <algorithm>
#include <thread>

#include "core/files.h"
#include "core/json_text.h"
#include "eval/compare/compare_tables.h"
#include "eval/score/evaluation_columns.h"
#include "eval/tools/base64.h"
#include "metrics/trajectory.h"

namespace tsdfpp {
namespace {

// The run of the baseline on the same frames and settings.
const CompareRun* BaselineOf(const CompareResult& result, const CompareRun& run) {
  for (const auto& other : result.runs) {
    if (other->config.method == Method::kTsdf && other->profile == run.profile &&
        other->config.poses == run.config.poses && other.get() != &run) {
      return other.get();
    }
  }
  return nullptr;
}

// Differences to the baseline on identical frames, of each column: at the examined frame, and the
// mean over the frames at which both are defined.
nlohmann::json PairedDifferences(const CompareResult& result, const CompareRun& run) {
  const CompareRun* baseline = BaselineOf(result, run);
  if (baseline == nullptr) {
    return ToJson(Measured::Undefined(run.config.method == Method::kTsdf
                                          ? "this is the baseline itself"
                                          : "the baseline was not run with these settings"));
  }
  nlohmann::json differences;
  for (const EvaluationColumn& column : EvaluationColumns()) {
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < run.evaluations.size(); ++i) {
      const Measured ours = column.value(result.movers, run.evaluations[i]);
      const Measured theirs = column.value(result.movers, baseline->evaluations[i]);
      if (!ours.value || !theirs.value) continue;
      sum += *ours.value - *theirs.value;
      ++count;
    }
    const Measured ours = column.value(result.movers, Examined(result, run));
    const Measured theirs = column.value(result.movers, Examined(result, *baseline));
    nlohmann::json& entry = differences[column.csv];
    entry["frames"] = count;
    entry["mean"] = ToJson(count == 0 ? Measured::Undefined("never defined for both maps")
                                      : Measured::Of(sum / count));
    entry["examined"] = ToJson(!ours.value     ? ours
                               : !theirs.value ? theirs
                                               : Measured::Of(*ours.value - *theirs.value));
  }
  return differences;
}

// Where the camera was found, beside where it was; nothing is aligned.
nlohmann::json CameraJson(const CompareResult& result, const CompareRun& run) {
  nlohmann::json camera{{"source", CameraSourceName(run.config.camera)}};
  if (run.config.camera == CameraSource::kGiven) return camera;
  const CameraLog& log = run.notes.camera;
  camera["located"] = log.located;
  camera["carried_on"] = log.carried_on;
  camera["lost"] = log.lost;
  if (const auto errors = PoseErrorsOf(PairByFrame(log.T_WC, result.camera))) {
    camera["translation_rmse_m"] = errors->translation_m.rmse;
    camera["rotation_rmse_deg"] = errors->rotation_deg.rmse;
  }
  return camera;
}

// Which objects; null with given poses.
nlohmann::json TrackedJson(const CompareRun& run) {
  if (run.config.poses == PoseSource::kGiven) return nullptr;
  return TrackChoiceName(run.pipeline.tracked().choice());
}

// Of the objects that moved, whether they are removed or not.
nlohmann::json TrajectoryJson(const CompareResult& result, const CompareRun& run) {
  nlohmann::json trajectories;
  for (const InstanceId id : result.truth->moved()) {
    const auto estimate = run.notes.trajectories.find(run.IdOf(id));
    const auto truth = result.truth->trajectories().find(id);
    if (estimate == run.notes.trajectories.end() || truth == result.truth->trajectories().end()) {
      continue;
    }
    const auto first =
        std::find_if(estimate->second.begin(), estimate->second.end(),
                     [&](const auto& pose) { return truth->second.contains(pose.first); });
    // Where the camera is given, both of its poses are the true one.
    Pose T_WC_estimate = Pose::Identity();
    Pose T_WC_truth = Pose::Identity();
    const auto& located = run.notes.camera.T_WC;
    if (first != estimate->second.end() && located.contains(first->first)) {
      T_WC_estimate = located.at(first->first);
      T_WC_truth = result.camera.at(first->first);
    }
    const ObjectTrajectoryScores scores =
        ScoreObjectTrajectory(estimate->second, truth->second, T_WC_estimate, T_WC_truth);
    trajectories[std::to_string(id)] = ToJson(scores);
  }
  return trajectories;
}

nlohmann::json RunJson(const CompareResult& result, const CompareRun& run) {
  const MapConfig& map = run.config.map;
  const MapMemory& memory = ExaminedMemory(result, run);
  nlohmann::json evaluations = nlohmann::json::array();
  for (const Evaluation& evaluation : run.evaluations) evaluations.push_back(ToJson(evaluation));
  return {{"title", run.Title()},
          {"folder", run.FolderName()},
          {"method", MethodName(run.config.method)},
          {"profile", run.profile},
          {"camera", CameraJson(result, run)},
          {"bleeding", BleedingPixelsName(run.config.BleedingWaits() ? BleedingPixels::kWait
                                                                     : BleedingPixels::kKeep)},
          {"segmentation", SegmentationName(run.config.segmentation)},
          {"mask_repair", MaskRepairModeName(run.config.mask_repair)},
          {"poses", PoseSourceName(run.config.poses)},
          {"tracked", TrackedJson(run)},
          {"associate", AssociationModeName(run.config.associate)},
          {"settings",
           {{"voxel_m", map.voxel_m},
            {"trunc_front_voxels", map.trunc_front_voxels},
            {"trunc_back_voxels", map.trunc_back_voxels},
            {"layers", LayersOf(run.config.method, map)},
            {"weight_cap", map.weight_cap},
            {"confidence_cap", map.confidence_cap},
            {"moved_confidence", map.moved_confidence},
            {"contradiction", map.contradiction},
            {"rims", map.rims},
            {"relist_on_removal", map.relist_on_removal},
            {"colour_whole_band", map.colour_whole_band},
            {"resampling", ResamplingName(map.resampling)},
            {"moved_voxels", MovedVoxelsName(map.moved_voxels)},
            {"removed_voxels", RemovedVoxelsName(map.removed_voxels)},
            {"vote_band_voxels", map.vote_band_voxels}}},
          {"examined", ToJson(Examined(result, run))},
          {"difference_to_tsdf", PairedDifferences(result, run)},
          {"trajectories", TrajectoryJson(result, run)},
          {"times", run.notes.times.ToJson()},
          {"map", {{"blocks", memory.blocks}, {"bytes", memory.bytes}}},
          {"process_growth_bytes", run.notes.process_growth_bytes},
          {"evaluations", evaluations}};
}

// The columns of an evaluation as cells of frames.csv, and their titles.
std::string CsvCells(const CompareResult& result, const Evaluation& evaluation) {
  std::string csv;
  const auto add = [&](const Measured& value) {
    csv += value.value ? fmt::format(",{:.6g}", *value.value) : ",";
  };
  for (const EvaluationColumn& column : EvaluationColumns()) {
    add(column.value(result.movers, evaluation));
    if (column.error) add(column.error(evaluation));
  }
  return csv;
}
std::string CsvTitles() {
  std::string csv;
  for (const EvaluationColumn& column : EvaluationColumns()) {
    csv += "," + column.csv;
    if (column.error) csv += "," + column.csv + "_se";
  }
  return csv;
}

std::string Csv(const CompareResult& result) {
  std::string csv = "frame,method,profile,poses" + CsvTitles() + ",mesh_s,evaluate_s\n";
  for (const auto& run : result.runs) {
    for (const Evaluation& evaluation : run->evaluations) {
      csv += fmt::format("{},{},{},{}", evaluation.frame, MethodName(run->config.method),
                         run->profile, PoseSourceName(run->config.poses));
      csv += CsvCells(result, evaluation);
      csv += fmt::format(",{:.4f},{:.4f}\n", evaluation.mesh_s, evaluation.evaluate_s);
    }
  }
  for (const auto& run : result.adapters) {
    for (const Evaluation& evaluation : run->evaluations) {
      csv += fmt::format("{},{},,", evaluation.frame, run->config.name);
      csv += CsvCells(result, evaluation);
      csv += fmt::format(",,{:.4f}\n", evaluation.evaluate_s);
    }
  }
  return csv;
}

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Headline(const CompareResult& result) {
  const int frame = result.reveal_frame.value_or(result.last_frame);
  std::string text;
  for (const auto& run : result.runs) {
    const ObjectScores& table = TableOf(Examined(result, *run));
    const auto& preserved = table.preserved;
    if (!preserved.preservation_behind_other.value) continue;
    text += fmt::format(
        "<li><b>{}</b> keeps {:.1f} % of the {:.0f} cm² of table that it had seen "
        "and that other objects hide at frame {}: a hole of {:.0f} cm².</li>\n",
        run->Title(), 100 * *preserved.preservation_behind_other.value,
        preserved.behind_other_area_cm2, frame, *preserved.hole_area_cm2.value);
  }
  return text;
}

}  // namespace

nlohmann::json SummaryJson(const CompareResult& result, const std::string& command) {
  nlohmann::json runs = nlohmann::json::array();
  for (const auto& run : result.runs) {
    runs.push_back(RunJson(result, *run));
    if (run->config.associate == AssociationMode::kVotes) {
      runs.back()["matched_ids"] = run->notes.matched_ids;
    }
    const std::vector<std::string> remarks = run->pipeline.Remarks();
    if (!remarks.empty()) runs.back()["remarks"] = remarks;
  }
  nlohmann::json summary{{"schema", 1},
                         {"generator", "tsdfpp"},
                         {"version", TSDFPP_VERSION},
                         {"command", command},
                         {"sequence", result.info.name},
                         {"first_frame", result.info.first_index},
                         {"last_frame", result.last_frame},
                         {"every", result.config.every},
                         {"removed", result.movers},
                         {"cores", std::thread::hardware_concurrency()},
                         {"read_s", result.read_s},
                         {"total_s", result.total_s},
                         {"runs", runs}};
  if (!result.run.empty()) summary["run"] = result.run;
  if (!result.config.truth_note.empty()) summary["truth"] = result.config.truth_note;
  if (!result.adapters.empty()) {
    summary["adapters"] = nlohmann::json::array();
    for (const auto& run : result.adapters) {
      nlohmann::json one = ToJson(*run);
      if (!run->failure) {
        one["title"] = TitleOf(*run);
        one["examined"] = ToJson(Examined(result, run->evaluations));
      }
      summary["adapters"].push_back(std::move(one));
    }
  }
  for (const FailedRun& run : result.failed) {
    summary["failed"].push_back({{"title", run.title},
                                 {"folder", run.folder},
                                 {"frame", run.frame},
                                 {"failure", run.error.message}});
  }
  if (result.stopped) summary["stopped"] = result.stopped->message;
  summary["reveal_frame"] =
      result.reveal_frame ? nlohmann::json(*result.reveal_frame) : nlohmann::json(nullptr);
  return summary;
}

Expected<void> WriteSummary(const CompareResult& result, const std::string& command,
                            const std::filesystem::path& out) {
  TSDFPP_RETURN_IF_ERROR(
      WriteFile(out / "summary.json", JsonText(SummaryJson(result, command), 1) + "\n"));
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "frames.csv", Csv(result)));
  return WriteFile(out / "table.txt", FrontTable(result) + SummaryTable(result, Times::kLeftOut));
}

namespace {

std::string PageHead(const CompareResult& result) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<title>tsdfpp: "
      "{0}</title>\n"
      "<style>body{{font:16px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 "
      "1em;color:#222}}"
      "table{{border-collapse:collapse;font-size:14px}}th,td{{padding:.25em .6em;text-align:right;"
      "border-bottom:1px solid #ddd}}th:first-child,td:first-child{{text-align:left}}"
      "img{{max-width:100%}}figure{{margin:2em 0}}figcaption{{color:#555;font-size:14px}}"
      "code{{background:#f3f3f3;padding:.1em "
      ".3em}}.scroll{{overflow-x:auto}}</style></head><body>\n"
      "<h1>What the map keeps of what it can no longer see</h1>\n"
      "<p>Sequence <b>{0}</b>, frames {1} to {2}, evaluated every {3} frames. {4} moving objects "
      "are removed from a copy "
      "of each map, not from the world; every score is taken on the visible scene "
      "mesh.</p>\n<ul>\n{5}</ul>\n",
      Escaped(result.info.name), result.info.first_index, result.last_frame, result.config.every,
      result.movers.size(), Headline(result));
}

// The front table and what its columns mean.
std::string PageTable(const CompareResult& result) {
  std::string html = "<div class=\"scroll\"><table>\n";
  const auto rows = TableRows(result, Times::kShown);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    html += "<tr>";
    for (const std::string& cell : rows[r]) {
      html += fmt::format("<{0}>{1}</{0}>", r == 0 ? "th" : "td", Escaped(cell));
    }
    html += "</tr>\n";
  }
  html +=
      "</table></div>\n<p>kept: share of the table that was seen before, is hidden by another "
      "object now, and is "
      "within one voxel of the map's table after the removal. retention: the same, over what the "
      "map had of it "
      "when it was last visible. visible: share of all that is seen now that the visible scene "
      "has. table: the same of the "
      "table. movers: mean completion of the moving objects. ghost: reconstructed area in space "
      "known to be free, before "
      "and after the removal, with the standard error of sampling; unseen: the same after the "
      "removal where nobody has seen that there is nothing. sane: share of mapped pixels whose "
      "depth and id the visible scene "
      "shows, over "
      "all and of the worst object. Times are medians a frame on this machine.</p>\n";
  return html;
}

std::string PageNotes(const CompareResult& result) {
  std::string html;
  if (!result.config.truth_note.empty()) {
    html += fmt::format("<p>{}</p>\n", Escaped(result.config.truth_note));
  }
  for (const std::string& line : FailureLines(result)) {
    html += fmt::format("<p>{}</p>\n", Escaped(line));
  }
  for (const std::string& line : AdapterLines(result)) {
    html += fmt::format("<p>{}</p>\n", Escaped(line));
  }
  return html;
}

Expected<std::string> PagePictures(const std::vector<PictureFile>& pictures,
                                   const std::filesystem::path& out) {
  std::string html;
  for (const PictureFile& picture : pictures) {
    TSDFPP_ASSIGN(const std::string bytes, ReadFile(out / picture.file));
    html += fmt::format(
        "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption>"
        "</figure>\n",
        Escaped(picture.caption), Base64(bytes));
  }
  return html;
}

}  // namespace

Expected<void> WriteReport(const CompareResult& result, const std::vector<PictureFile>& pictures,
                           const std::string& command, const std::filesystem::path& out) {
  TSDFPP_ASSIGN(const std::string shown, PagePictures(pictures, out));
  std::string html = PageHead(result) + PageTable(result) + PageNotes(result) + shown;
  html += fmt::format(
      "<p>Made by <code>{}</code>, tsdfpp {}. All figures: <code>summary.json</code>, "
      "<code>frames.csv</code>.</p>\n</body></html>\n",
      Escaped(command), TSDFPP_VERSION);
  return WriteFile(out / "report.html", html);
}

}  // namespace tsdfpp
