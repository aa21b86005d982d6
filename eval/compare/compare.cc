#include "eval/compare/compare.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fstream>
#include <set>

#include "core/files.h"
#include "core/guard.h"
#include "eval/compare/compare_adapters.h"
#include "eval/compare/compare_report.h"
#include "eval/compare/pictures.h"
#include "eval/compare/report_record.h"
#include "eval/run/compare_names.h"
#include "eval/run/run_folder.h"
#include "eval/score/mesh_folder.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

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
  const bool ids_are_objects = IdsAreObjects(config, info);
  if (IdsAreOfOneFrame(config.segmentation) &&
      AssociationOf(config, info) == AssociationMode::kGiven) {
    return UsageError(
        "--associate given: the ids of --segmentation {} are drawn anew in every frame, expected "
        "--associate votes",
        SegmentationName(config.segmentation));
  }
  if (!ids_are_objects && AssociationOf(config, info) == AssociationMode::kGiven) {
    return UsageError(
        "--associate given: the ids in the masks of {} are drawn anew in every frame, expected "
        "--associate votes",
        info.name);
  }
  for (const PoseSource poses : config.poses) {
    for (const std::string& profile : config.profiles) {
      for (const Method method : config.methods) {
        PipelineConfig pipeline{.method = method,
                                .map = config.map,
                                .segmentation = config.segmentation,
                                .segmenter = config.segmenter,
                                .bleeding = config.bleeding,
                                .associate = AssociationOf(config, info),
                                .votes = config.votes,
                                .mask_repair = config.mask_repair,
                                .repair = config.repair,
                                .camera = config.camera,
                                .poses = poses,
                                .tracked = config.tracked,
                                .icp = config.icp,
                                .track = config.track};
        TSDFPP_RETURN_IF_ERROR(pipeline.map.SetProfile(profile));
        TSDFPP_RETURN_IF_ERROR(pipeline.Validate());
        const std::vector<ObjectInfo> nobody;
        runs.push_back(std::make_unique<CompareRun>(
            pipeline, profile, ids_are_objects ? info.objects : nobody, truth));
      }
    }
  }
  return runs;
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

// Drops what is of later frames.
void EndAt(int last_frame, Trajectory& trajectory) {
  trajectory.erase(trajectory.upper_bound(last_frame), trajectory.end());
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
  return folder.CheckPlaces(files);
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

bool IsEvaluated(const CompareResult& result, int frame) {
  return (frame - result.info.first_index + 1) % result.config.every == 0 ||
         frame == result.last_frame || frame == result.reveal_frame;
}

namespace {

// What the config and the sequence say of the comparison, before anything is written.
Expected<CompareResult> Planned(const FrameSource& source, const CompareConfig& config,
                                const std::filesystem::path& out_folder) {
  CompareResult result;
  result.info = source.info();
  result.config = config;
  TSDFPP_ASSIGN(result.last_frame, LastFrame(result.info, config.until));
  if (config.every < 1) return UsageError("--every is {}, expected 1 or more", config.every);
  if (IsOurSequence(out_folder)) {
    return UsageError("--out '{}' is a sequence, expected another folder", out_folder.string());
  }
  return result;
}

// The true surfaces, what is removed and when, and the maps.
Expected<void> SetUp(FrameSource& source, CompareResult& result) {
  TSDFPP_ASSIGN(SceneTruth truth, SceneTruth::Create(source, result.config.truth));
  result.truth = std::make_unique<SceneTruth>(std::move(truth));
  if (result.info.reveal) {
    result.movers = {result.info.reveal->removed.begin(), result.info.reveal->removed.end()};
    if (result.info.reveal->frame <= result.last_frame) {
      result.reveal_frame = result.info.reveal->frame;
    }
  }
  TSDFPP_ASSIGN(result.runs, MakeRuns(result.config, result.info, *result.truth));
  return {};
}

// The frames one after the other: the truth and the maps see each, and what is evaluated is drawn
// and recorded.
class FrameWalk {
 public:
  // All must outlive it; `result` has its runs and what the adapters did.
  FrameWalk(FrameSource& source, const AdapterTask& task, const std::filesystem::path& out,
            CompareResult& result)
      : source_(source), task_(task), out_(out), result_(result), pictures_(result, out) {
    if (result.config.record) recorder_.emplace(result, out);
    for (std::size_t i = 0; i < result.truth->trackers().size(); ++i) {
      names_.push_back(result.truth->surface(i).model().info);
    }
  }

  // Goes through the planned frames, as far as they can be had. Errors: as of RunCompare, where
  // nothing is left to show.
  Expected<void> Go(const CompareProgress& progress) {
    const int first = result_.info.first_index;
    for (int index = first; index <= result_.last_frame; ++index) {
      const auto read_start = Clock::now();
      auto frames = Guarded([&] { return SeeFrame(source_, index, *result_.truth); });
      result_.read_s += SecondsSince(read_start);
      if (!frames) {
        result_.stopped = std::move(frames.error());
        return EndAtLastEvaluated();
      }
      const Frame& frame = frames->given;
      const Frame& true_frame = frames->true_frame ? *frames->true_frame : frame;
      result_.camera[index] = true_frame.T_WC;
      if (recorder_) recorder_->SeeFrame(true_frame);
      MapFrame(frame, true_frame.mask);
      if (IsEvaluated(result_, index)) EvaluateAdapters(frame);
      if (progress) progress(index - first + 1, result_.last_frame - first + 1);
      if (IsNothingLeft()) return tl::unexpected(NothingLeft(result_));
    }
    return {};
  }

  // Scores the adapters' trajectories and writes figures and recording.
  Expected<void> Finish() {
    std::map<InstanceId, Trajectory> truth = result_.truth->trajectories();
    for (auto& [id, trajectory] : truth) EndAt(result_.last_frame, trajectory);
    for (const auto& run : result_.adapters) {
      ScoreAdapterTrajectories(*run, names_, truth, result_.camera);
    }
    // Figures and the recording are of all frames that were planned, or not at all.
    if (result_.stopped) return recorder_ ? recorder_->Discard() : Expected<void>{};
    TSDFPP_RETURN_IF_ERROR(Guarded([&] { return pictures_.Finish(); }));
    if (recorder_) TSDFPP_RETURN_IF_ERROR(Guarded([&] { return recorder_->Write(); }));
    return {};
  }

  const std::vector<PictureFile>& pictures() const { return pictures_.files(); }

 private:
  // Gives the frame to each map; one that fails is left out from then on. `true_mask` is what its
  // pixels show.
  void MapFrame(const Frame& frame, const cv::Mat& true_mask) {
    for (std::size_t r = 0; r < result_.runs.size();) {
      CompareRun& run = *result_.runs[r];
      const auto mapped = Guarded([&]() -> Expected<void> {
        const std::int64_t before = ResidentBytes();
        const int lost_before = run.pipeline.camera_log().lost;
        TSDFPP_ASSIGN(const StepTimes step, run.pipeline.Process(frame));
        run.times.Add(step);
        // Where the camera was not found, nothing was mapped, and the labels are older.
        const bool is_mapped = run.pipeline.camera_log().lost == lost_before;
        if (is_mapped && run.config.associate == AssociationMode::kVotes) {
          run.matching.Observe(run.pipeline.labels(), true_mask);
        }
        run.process_growth_bytes += ResidentBytes() - before;
        if (recorder_) recorder_->SeeMap(run);
        if (!IsEvaluated(result_, frame.index)) return {};
        return EvaluateRun(run, frame);
      });
      if (mapped) {
        ++r;
        continue;
      }
      result_.failed.push_back({run.Title(), run.FolderName(), frame.index, mapped.error()});
      if (recorder_) recorder_->Forget(run);
      result_.runs.erase(result_.runs.begin() + static_cast<std::ptrdiff_t>(r));
    }
  }

  // Evaluates a map and writes what is to be seen of it.
  Expected<void> EvaluateRun(CompareRun& run, const Frame& frame) {
    const int index = frame.index;
    const bool votes = run.config.associate == AssociationMode::kVotes;
    if (votes) run.matching.Settle();
    SceneMeshes meshes =
        votes ? MeshesOf(run.pipeline.map(), result_.movers, run.matching, run.mesher)
              : MeshesOf(run.pipeline.map(), result_.movers, run.mesher);
    if (result_.config.keep_meshes) {
      TSDFPP_RETURN_IF_ERROR(WriteMeshFolder(meshes, out_ / run.FolderName() / "frames", index));
    }
    run.evaluations.push_back(EvaluateMeshes(std::move(meshes), *result_.truth, names_,
                                             result_.movers, run.config.map.voxel_m,
                                             run.last_seen));
    Evaluation& evaluation = run.evaluations.back();
    run.times.mesh_s.push_back(evaluation.mesh_s);
    run.TakeNotes();
    TSDFPP_RETURN_IF_ERROR(pictures_.Take(&run, evaluation, frame));
    if (recorder_) TSDFPP_RETURN_IF_ERROR(recorder_->Take(run, evaluation, frame));
    const bool examined = index == result_.reveal_frame.value_or(result_.last_frame);
    if (examined) {
      auto copy = run.pipeline.map().Clone();
      for (const InstanceId id : result_.movers) {
        if (run.IdOf(id) != kNoInstance) copy->Remove(run.IdOf(id));
      }
      SequenceInfo info = result_.info;
      info.objects = run.pipeline.Objects();
      TSDFPP_RETURN_IF_ERROR(WriteMap(*copy, run.pipeline, info, out_ / run.FolderName()));
    }
    DropMeshes(evaluation);
    return {};
  }

  void EvaluateAdapters(const Frame& frame) {
    for (const auto& run : result_.adapters) {
      const auto scored = Guarded([&]() -> Expected<void> {
        EvaluateAdapter(*run, *result_.truth, names_, task_);
        if (run->failure) return {};
        Evaluation& evaluation = run->evaluations.back();
        TSDFPP_RETURN_IF_ERROR(pictures_.Take(run.get(), evaluation, frame));
        DropMeshes(evaluation);
        return {};
      });
      if (!scored) {
        run->Fail({scored.error().kind, run->config.name + ": " + scored.error().message});
      }
    }
  }

  bool IsNothingLeft() const {
    const bool any_adapter = std::any_of(result_.adapters.begin(), result_.adapters.end(),
                                         [](const auto& run) { return !run->failure.has_value(); });
    return result_.runs.empty() && !any_adapter && !result_.failed.empty();
  }

  // The results are those until the last frame at which all that is left was evaluated.
  Expected<void> EndAtLastEvaluated() {
    const int seen = LastEvaluated(result_);
    if (seen < result_.info.first_index) return tl::unexpected(*result_.stopped);
    result_.last_frame = seen;
    EndAt(seen, result_.camera);
    if (result_.reveal_frame && *result_.reveal_frame > seen) result_.reveal_frame.reset();
    return {};
  }

  FrameSource& source_;
  const AdapterTask& task_;
  const std::filesystem::path& out_;
  CompareResult& result_;
  PictureMaker pictures_;
  std::optional<ReportRecorder> recorder_;
  std::vector<ObjectInfo> names_;
};

}  // namespace

Expected<CompareResult> RunCompare(FrameSource& source, const CompareConfig& config,
                                   const std::filesystem::path& out_folder,
                                   const std::string& command, const CompareProgress& progress) {
  const auto start = Clock::now();
  TSDFPP_ASSIGN(CompareResult result, Planned(source, config, out_folder));
  // Maps that cannot be made leave no folder.
  TSDFPP_RETURN_IF_ERROR(SetUp(source, result));
  TSDFPP_ASSIGN(RunFolder folder, RunFolder::Begin(out_folder, command));
  result.run = folder.id();
  TSDFPP_RETURN_IF_ERROR(CheckPlaces(result, folder));

  TSDFPP_ASSIGN(const AdapterTask task, TaskForAdapters(result));
  TSDFPP_RETURN_IF_ERROR(RunAdapters(source, task, folder, result));
  FrameWalk walk(source, task, folder.path(), result);
  TSDFPP_RETURN_IF_ERROR(walk.Go(progress));
  TSDFPP_RETURN_IF_ERROR(walk.Finish());

  result.total_s = SecondsSince(start);
  TSDFPP_RETURN_IF_ERROR(WriteSummary(result, command, folder.path()));
  TSDFPP_RETURN_IF_ERROR(WriteReport(result, walk.pictures(), command, folder.path()));
  // `tsdfpp report` writes another page in its place.
  TSDFPP_RETURN_IF_ERROR(folder.Commit({kPageFile}));
  for (const auto& run : result.adapters) run->folder = run->shown;
  return result;
}

}  // namespace tsdfpp
