#include "eval/compare.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fstream>

#include "core/files.h"
#include "eval/compare_names.h"
#include "eval/compare_report.h"
#include "eval/mesh_folder.h"
#include "eval/pictures.h"
#include "eval/report_record.h"
#include "eval/run_folder.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

std::int64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  std::int64_t size = 0;
  std::int64_t resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

Expected<int> LastFrame(const SequenceInfo& info, const std::string& until) {
  const int last = info.first_index + info.frame_count - 1;
  if (until == "end") return last;
  if (until == "reveal") return info.reveal ? info.reveal->frame : last;
  int frame = 0;
  const auto [rest, status] = std::from_chars(until.data(), until.data() + until.size(), frame);
  if (status != std::errc() || rest != until.data() + until.size()) {
    return UsageError("--until is '{}', expected reveal, end or a frame's number", until);
  }
  if (frame < info.first_index || frame > last) {
    return UsageError("--until {} is out of range: {} has frames {} to {}", frame, info.name,
                      info.first_index, last);
  }
  return frame;
}

Expected<std::vector<std::unique_ptr<CompareRun>>> MakeRuns(const CompareConfig& config,
                                                            const SequenceInfo& info,
                                                            const SceneTruth& truth) {
  std::vector<std::unique_ptr<CompareRun>> runs;
  for (const PoseSource poses : config.poses) {
    for (const std::string& profile : config.profiles) {
      for (const Method method : config.methods) {
        PipelineConfig pipeline{method, config.map, poses, config.icp};
        TSDFPP_RETURN_IF_ERROR(pipeline.map.SetProfile(profile));
        TSDFPP_RETURN_IF_ERROR(pipeline.map.Validate());
        runs.push_back(std::make_unique<CompareRun>(pipeline, profile, info.objects, truth));
      }
    }
  }
  return runs;
}

// Runs the adapters, one after the other, on the frames as they are given to a mapper.
Expected<void> RunAdapters(FrameSource& source, const AdapterTask& given, const RunFolder& folder,
                           CompareResult& result) {
  const std::filesystem::path& out = folder.path();
  std::map<DatasetFormat, std::filesystem::path> sequences;
  Expected<void> done;
  for (const AdapterConfig& adapter : result.config.adapters) {
    const DatasetFormat layout = adapter.layout;
    std::filesystem::path& sequence = sequences[layout];
    if (sequence.empty()) {
      sequence = out / fmt::format(".sequence-{}", DatasetFormatName(layout));
      std::error_code ignored;
      std::filesystem::remove_all(sequence, ignored);
      done = WriteForAdapters(source, layout, result.last_frame, sequence);
    }
    if (!done) break;
    AdapterTask task = given;
    task.sequence = sequence;
    AdapterRun& run = *result.adapters.emplace_back(std::make_unique<AdapterRun>(adapter));
    done = RunAdapter(run, task, out / adapter.name, folder.out() / adapter.name);
    if (!done) break;
  }
  for (const auto& [layout, sequence] : sequences) {
    std::error_code ignored;
    std::filesystem::remove_all(sequence, ignored);
  }
  return done;
}

// Scores what an adapter wrote of its trajectories, if anything.
void ScoreTrajectories(AdapterRun& run, const std::vector<ObjectInfo>& names,
                       const SceneTruth& truth, const Trajectory& camera) {
  const std::filesystem::path folder = run.folder / "trajectories";
  std::error_code ignored;
  if (run.failure || run.matches.empty() || !std::filesystem::exists(folder, ignored)) return;
  auto scores =
      EvaluateTrajectories(folder, names, run.matches.back(), truth.trajectories(), camera);
  if (scores) {
    run.trajectories = std::move(*scores);
  } else {
    run.failure =
        Error{scores.error().kind,
              WithShownFolder(run, fmt::format("{}: {}", run.config.name, scores.error().message))};
  }
}

}  // namespace

CompareRun::CompareRun(const PipelineConfig& pipeline_config, std::string profile_name,
                       const std::vector<ObjectInfo>& objects, const SceneTruth& truth)
    : config(pipeline_config),
      profile(std::move(profile_name)),
      pipeline(config, objects),
      last_seen(MakeLastSeenStores(truth)) {}

std::string CompareRun::Title() const {
  return fmt::format("{}, {}, {}", MethodName(config.method), profile,
                     config.poses == PoseSource::kGiven ? "given poses" : "ICP");
}

std::string CompareRun::FolderName() const {
  std::string name =
      fmt::format("{}_{}_{}", MethodName(config.method), profile, PoseSourceName(config.poses));
  std::replace(name.begin(), name.end(), '/', '-');
  return name;
}

bool IsEvaluated(const CompareResult& result, int frame) {
  return (frame - result.info.first_index + 1) % result.config.every == 0 ||
         frame == result.last_frame || frame == result.reveal_frame;
}

Expected<CompareResult> RunCompare(FrameSource& source, const CompareConfig& config,
                                   const std::filesystem::path& out_folder,
                                   const std::string& command, const CompareProgress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const auto since = [](std::chrono::steady_clock::time_point t) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - t).count();
  };
  CompareResult result;
  result.info = source.info();
  result.config = config;
  TSDFPP_ASSIGN(result.last_frame, LastFrame(result.info, config.until));
  if (config.every < 1) return UsageError("--every is {}, expected 1 or more", config.every);
  if (IsOurSequence(out_folder)) {
    return UsageError("--out '{}' is a sequence, expected another folder", out_folder.string());
  }
  TSDFPP_ASSIGN(RunFolder folder_of_run, RunFolder::Begin(out_folder, command));
  const std::filesystem::path& out = folder_of_run.path();
  result.run = folder_of_run.id();
  TSDFPP_ASSIGN(SceneTruth truth, SceneTruth::Create(source, config.truth));
  result.truth = std::make_unique<SceneTruth>(std::move(truth));
  std::vector<ObjectInfo> names;
  for (std::size_t i = 0; i < result.truth->trackers().size(); ++i) {
    names.push_back(result.truth->surface(i).model().info);
  }
  if (result.info.reveal) {
    result.movers = {result.info.reveal->removed.begin(), result.info.reveal->removed.end()};
    if (result.info.reveal->frame <= result.last_frame) {
      result.reveal_frame = result.info.reveal->frame;
    }
  }
  TSDFPP_ASSIGN(result.runs, MakeRuns(config, result.info, *result.truth));

  const int first = result.info.first_index;
  const int total = result.last_frame - first + 1;
  AdapterTask task{{}, first, result.last_frame, {}, result.movers, config.map.voxel_m, 0};
  for (int index = first; index <= result.last_frame; ++index) {
    if (IsEvaluated(result, index)) task.frames.push_back(index);
  }
  MapConfig settings = config.map;
  if (!config.profiles.empty()) {
    TSDFPP_RETURN_IF_ERROR(settings.SetProfile(config.profiles.front()));
  }
  task.truncation_m = settings.voxel_m * settings.trunc_front_voxels;
  task.truncation_back_m = settings.voxel_m * settings.trunc_back_voxels;
  TSDFPP_RETURN_IF_ERROR(RunAdapters(source, task, folder_of_run, result));
  Trajectory camera;
  PictureMaker pictures(result, out);
  std::optional<ReportRecorder> recorder;
  if (config.record) recorder.emplace(result, out);
  for (int index = first; index <= result.last_frame; ++index) {
    const auto read_start = std::chrono::steady_clock::now();
    TSDFPP_ASSIGN(const Frame frame, source.Read(index));
    std::optional<Frame> true_frame;
    if (source.IsSensed()) {
      TSDFPP_ASSIGN(true_frame, source.ReadTrue(index));
    }
    result.read_s += since(read_start);
    if (frame.mask.empty()) return DataError("{}: frame {} has no mask", result.info.name, index);
    TSDFPP_RETURN_IF_ERROR(result.truth->Observe(true_frame ? *true_frame : frame));
    camera[index] = true_frame ? true_frame->T_WC : frame.T_WC;
    const bool reveal = index == result.reveal_frame;
    const bool evaluate = IsEvaluated(result, index);
    if (recorder) recorder->SeeFrame(true_frame ? *true_frame : frame);
    for (const auto& run : result.runs) {
      const std::int64_t before = ResidentBytes();
      run->times.Add(run->pipeline.Process(frame));
      run->process_growth_bytes += ResidentBytes() - before;
      if (recorder) recorder->SeeMap(*run);
      if (!evaluate) continue;
      SceneMeshes meshes = MeshesOf(run->pipeline.map(), result.movers);
      if (config.keep_meshes) {
        TSDFPP_RETURN_IF_ERROR(WriteMeshFolder(meshes, out / run->FolderName() / "frames", index));
      }
      run->evaluations.push_back(EvaluateMeshes(std::move(meshes), *result.truth, names,
                                                result.movers, run->config.map.voxel_m,
                                                run->last_seen));
      Evaluation& evaluation = run->evaluations.back();
      run->times.mesh_s.push_back(evaluation.mesh_s);
      TSDFPP_RETURN_IF_ERROR(pictures.Take(run.get(), evaluation, frame));
      if (recorder) TSDFPP_RETURN_IF_ERROR(recorder->Take(*run, evaluation, frame));
      const bool examined = reveal || (!result.reveal_frame && index == result.last_frame);
      if (examined) {
        const std::filesystem::path folder = out / run->FolderName();
        auto copy = run->pipeline.map().Clone();
        for (const InstanceId id : result.movers) copy->Remove(id);
        TSDFPP_RETURN_IF_ERROR(WriteMap(*copy, run->pipeline, result.info, folder));
      }
      evaluation.scene = {};
      evaluation.revealed = {};
      evaluation.table_reconstructed = {};
    }
    for (const auto& run : result.adapters) {
      if (!evaluate) continue;
      EvaluateAdapter(*run, *result.truth, names, task);
      if (run->failure) continue;
      Evaluation& evaluation = run->evaluations.back();
      TSDFPP_RETURN_IF_ERROR(pictures.Take(run.get(), evaluation, frame));
      evaluation.scene = {};
      evaluation.revealed = {};
      evaluation.table_reconstructed = {};
    }
    if (progress) progress(index - first + 1, total);
  }
  for (const auto& run : result.adapters) ScoreTrajectories(*run, names, *result.truth, camera);
  TSDFPP_RETURN_IF_ERROR(pictures.Finish());
  if (recorder) TSDFPP_RETURN_IF_ERROR(recorder->Write());
  result.total_s = since(start);
  TSDFPP_RETURN_IF_ERROR(WriteSummary(result, command, out));
  TSDFPP_RETURN_IF_ERROR(WriteReport(result, pictures.files(), command, out));
  // `tsdfpp report` writes another page in its place.
  TSDFPP_RETURN_IF_ERROR(folder_of_run.Commit({kPageFile}));
  for (const auto& run : result.adapters) run->folder = run->shown;
  return result;
}

}  // namespace tsdfpp
