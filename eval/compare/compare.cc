#include "eval/compare/compare.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fstream>
#include <set>

#include "core/files.h"
#include "core/folders.h"
#include "core/guard.h"
#include "core/one_line.h"
#include "eval/compare/compare_report.h"
#include "eval/compare/pictures.h"
#include "eval/compare/report_record.h"
#include "eval/run/compare_names.h"
#include "eval/run/run_folder.h"
#include "eval/score/mesh_folder.h"
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

AssociationMode AssociationOf(const CompareConfig& config, const SequenceInfo& info) {
  return config.associate.value_or(info.mask_ids_are_objects ? AssociationMode::kGiven
                                                             : AssociationMode::kVotes);
}

Expected<std::vector<std::unique_ptr<CompareRun>>> MakeRuns(const CompareConfig& config,
                                                            const SequenceInfo& info,
                                                            const SceneTruth& truth) {
  std::vector<std::unique_ptr<CompareRun>> runs;
  for (const PoseSource poses : config.poses) {
    for (const std::string& profile : config.profiles) {
      for (const Method method : config.methods) {
        PipelineConfig pipeline{.method = method,
                                .map = config.map,
                                .associate = AssociationOf(config, info),
                                .poses = poses,
                                .icp = config.icp};
        TSDFPP_RETURN_IF_ERROR(pipeline.map.SetProfile(profile));
        TSDFPP_RETURN_IF_ERROR(pipeline.Validate());
        const std::vector<ObjectInfo> nobody;
        runs.push_back(std::make_unique<CompareRun>(
            pipeline, profile, info.mask_ids_are_objects ? info.objects : nobody, truth));
      }
    }
  }
  return runs;
}

// What an adapter left beside its own folder would become files of the run, or stand in their way.
void RemoveStrays(AdapterRun& run, const std::filesystem::path& out,
                  const std::vector<std::filesystem::path>& before) {
  for (const std::filesystem::path& entry : EntriesOf(out)) {
    if (entry == out / run.config.name || std::binary_search(before.begin(), before.end(), entry)) {
      continue;
    }
    std::error_code ignored;
    std::filesystem::remove_all(entry, ignored);
    run.remarks.push_back(fmt::format("{}: left {} beside its own folder, which is removed",
                                      run.config.name, Quoted(entry.filename().string())));
  }
}

// Folders nested so deep that no path leads to what is in them would be the comparison's end.
void RemoveWhatCannotBeListed(AdapterRun& run) {
  const auto files = ListFilesBelow(run.folder);
  if (files) return;
  std::error_code ignored;
  std::filesystem::remove_all(run.folder, ignored);
  std::filesystem::create_directory(run.folder, ignored);
  run.failure = Error{ErrorKind::kData,
                      WithShownFolder(run, fmt::format("{}: what it left is removed: {}",
                                                       run.config.name, files.error().message))};
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
    const std::vector<std::filesystem::path> before = EntriesOf(out);
    done = RunAdapter(run, task, out / adapter.name, folder.out() / adapter.name);
    if (!done) break;
    RemoveStrays(run, out, before);
    RemoveWhatCannotBeListed(run);
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

// A frame as the sensor gave it and, where that differs, as it was.
struct SeenFrames {
  Frame given;
  std::optional<Frame> true_frame;
};

// Reads a frame and lets the truth see it.
Expected<SeenFrames> SeeFrame(FrameSource& source, int index, SceneTruth& truth) {
  SeenFrames frames;
  TSDFPP_ASSIGN(frames.given, source.Read(index));
  if (source.IsSensed()) {
    TSDFPP_ASSIGN(frames.true_frame, source.ReadTrue(index));
  }
  if (frames.given.mask.empty()) {
    return DataError("{}: frame {} has no mask", source.info().name, index);
  }
  TSDFPP_RETURN_IF_ERROR(truth.Observe(frames.true_frame ? *frames.true_frame : frames.given));
  return frames;
}

// What pictures needed of an evaluation.
void DropMeshes(Evaluation& evaluation) {
  evaluation.scene = {};
  evaluation.revealed = {};
  evaluation.table_reconstructed = {};
}

// Evaluates a map at a frame and writes what is to be seen of it.
Expected<void> EvaluateRun(CompareRun& run, const Frame& frame,
                           const std::vector<ObjectInfo>& names, const std::filesystem::path& out,
                           const CompareResult& result, PictureMaker& pictures,
                           std::optional<ReportRecorder>& recorder) {
  const int index = frame.index;
  const bool votes = run.config.associate == AssociationMode::kVotes;
  if (votes) run.matching.Settle();
  SceneMeshes meshes = votes ? MeshesOf(run.pipeline.map(), result.movers, run.matching)
                             : MeshesOf(run.pipeline.map(), result.movers);
  if (result.config.keep_meshes) {
    TSDFPP_RETURN_IF_ERROR(WriteMeshFolder(meshes, out / run.FolderName() / "frames", index));
  }
  run.evaluations.push_back(EvaluateMeshes(std::move(meshes), *result.truth, names, result.movers,
                                           run.config.map.voxel_m, run.last_seen));
  Evaluation& evaluation = run.evaluations.back();
  run.times.mesh_s.push_back(evaluation.mesh_s);
  TSDFPP_RETURN_IF_ERROR(pictures.Take(&run, evaluation, frame));
  if (recorder) TSDFPP_RETURN_IF_ERROR(recorder->Take(run, evaluation, frame));
  const bool examined = index == result.reveal_frame.value_or(result.last_frame);
  if (examined) {
    auto copy = run.pipeline.map().Clone();
    for (const InstanceId id : result.movers) {
      if (run.IdOf(id) != kNoInstance) copy->Remove(run.IdOf(id));
    }
    SequenceInfo info = result.info;
    if (votes) info.objects = run.pipeline.Objects();
    TSDFPP_RETURN_IF_ERROR(WriteMap(*copy, run.pipeline, info, out / run.FolderName()));
  }
  DropMeshes(evaluation);
  return {};
}

// Where no map and no adapter is left.
Error NothingLeft(const CompareResult& result) {
  const FailedRun& first = result.failed.front();
  return {first.error.kind,
          fmt::format("{}, at frame {}: {}{}", first.title, first.frame, first.error.message,
                      result.failed.size() > 1 ? "; and the others too" : "")};
}

// Says before the work what would stand in the way of a run's files.
Expected<void> CheckPlaces(const CompareResult& result, const RunFolder& folder) {
  std::set<std::string> files{kSummaryFile, kFramesFile, kPageFile};
  for (const auto& run : result.runs) files.insert(run->FolderName() + "/mesh/scene.ply");
  for (const AdapterConfig& adapter : result.config.adapters) {
    files.insert(adapter.name + "/log.txt");
  }
  return folder.CheckPlaces(std::move(files));
}

// The last frame at which all that is left was evaluated; before the first where there is none.
int LastEvaluated(const CompareResult& result) {
  int last = result.info.first_index - 1;
  for (const auto& run : result.runs) {
    if (!run->evaluations.empty()) last = std::max(last, run->evaluations.back().frame);
  }
  for (const auto& run : result.adapters) {
    if (!run->failure && !run->evaluations.empty()) {
      last = std::max(last, run->evaluations.back().frame);
    }
  }
  return last;
}

}  // namespace

CompareRun::CompareRun(const PipelineConfig& pipeline_config, std::string profile_name,
                       const std::vector<ObjectInfo>& objects, const SceneTruth& truth)
    : config(pipeline_config),
      profile(std::move(profile_name)),
      pipeline(config, objects),
      last_seen(MakeLastSeenStores(truth)) {}

std::string CompareRun::Title() const {
  return fmt::format("{}, {}, {}{}", MethodName(config.method), profile,
                     config.poses == PoseSource::kGiven ? "given poses" : "ICP",
                     config.associate == AssociationMode::kVotes ? ", ids by votes" : "");
}

std::string CompareRun::FolderName() const {
  return RunFolderName(config.method, profile, config.poses);
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
  TSDFPP_RETURN_IF_ERROR(CheckPlaces(result, folder_of_run));

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
  const int planned = result.last_frame;
  for (int index = first; index <= planned; ++index) {
    const auto read_start = std::chrono::steady_clock::now();
    auto frames = Guarded([&] { return SeeFrame(source, index, *result.truth); });
    result.read_s += since(read_start);
    if (!frames) {
      result.stopped = std::move(frames.error());
      break;
    }
    const Frame& frame = frames->given;
    const Frame& true_frame = frames->true_frame ? *frames->true_frame : frame;
    camera[index] = true_frame.T_WC;
    const bool evaluate = IsEvaluated(result, index);
    if (recorder) recorder->SeeFrame(true_frame);
    for (std::size_t r = 0; r < result.runs.size();) {
      CompareRun& run = *result.runs[r];
      const auto mapped = Guarded([&]() -> Expected<void> {
        const std::int64_t before = ResidentBytes();
        TSDFPP_ASSIGN(const StepTimes step, run.pipeline.Process(frame));
        run.times.Add(step);
        if (run.config.associate == AssociationMode::kVotes) {
          run.matching.Observe(run.pipeline.labels(), true_frame.mask);
        }
        run.process_growth_bytes += ResidentBytes() - before;
        if (recorder) recorder->SeeMap(run);
        if (!evaluate) return {};
        return EvaluateRun(run, frame, names, out, result, pictures, recorder);
      });
      if (mapped) {
        ++r;
        continue;
      }
      result.failed.push_back({run.Title(), run.FolderName(), index, mapped.error()});
      if (recorder) recorder->Forget(run);
      result.runs.erase(result.runs.begin() + static_cast<std::ptrdiff_t>(r));
    }
    for (const auto& run : result.adapters) {
      if (!evaluate) continue;
      const auto scored = Guarded([&]() -> Expected<void> {
        EvaluateAdapter(*run, *result.truth, names, task);
        if (run->failure) return {};
        Evaluation& evaluation = run->evaluations.back();
        TSDFPP_RETURN_IF_ERROR(pictures.Take(run.get(), evaluation, frame));
        DropMeshes(evaluation);
        return {};
      });
      if (!scored)
        run->failure = Error{scored.error().kind, run->config.name + ": " + scored.error().message};
    }
    if (progress) progress(index - first + 1, total);
    const bool any_adapter = std::any_of(result.adapters.begin(), result.adapters.end(),
                                         [](const auto& run) { return !run->failure.has_value(); });
    if (result.runs.empty() && !any_adapter && !result.failed.empty()) {
      return tl::unexpected(NothingLeft(result));
    }
  }
  if (result.stopped) {
    const int seen = LastEvaluated(result);
    if (seen < first) return tl::unexpected(*result.stopped);
    result.last_frame = seen;
    if (result.reveal_frame && *result.reveal_frame > seen) result.reveal_frame.reset();
  }
  for (const auto& run : result.adapters) ScoreTrajectories(*run, names, *result.truth, camera);
  // Figures and the recording are of all frames that were planned, or not at all.
  if (!result.stopped) {
    TSDFPP_RETURN_IF_ERROR(Guarded([&] { return pictures.Finish(); }));
    if (recorder) TSDFPP_RETURN_IF_ERROR(Guarded([&] { return recorder->Write(); }));
  }
  result.total_s = since(start);
  TSDFPP_RETURN_IF_ERROR(WriteSummary(result, command, out));
  TSDFPP_RETURN_IF_ERROR(WriteReport(result, pictures.files(), command, out));
  // `tsdfpp report` writes another page in its place.
  TSDFPP_RETURN_IF_ERROR(folder_of_run.Commit({kPageFile}));
  for (const auto& run : result.adapters) run->folder = run->shown;
  return result;
}

}  // namespace tsdfpp
