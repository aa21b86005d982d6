#include "bench/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <utility>

#include "bench/camera_clock.h"
#include "bench/figure_runs.h"
#include "core/toml_reader.h"
#include "mapper/pipeline.h"
#include "metrics/trajectory.h"
#include "sequence/open_sequence.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// Some 2 cm and 1 degree along and about all axes together: of each frame alone, and of a walk at
// its 256th frame.
constexpr double kJitter_m = 0.012;
constexpr double kJitter_deg = 0.6;
constexpr double kDriftSteps = 16;  // the root of the number of frames

enum class Given { kTrue, kDrift, kJitter };

SensorConfig PoseNoise(Given given) {
  SensorConfig sensor;
  if (given == Given::kJitter) {
    sensor.camera_pose.jitter_m = kJitter_m;
    sensor.camera_pose.jitter_deg = kJitter_deg;
  } else if (given == Given::kDrift) {
    sensor.camera_pose.drift_m = kJitter_m / kDriftSteps;
    sensor.camera_pose.drift_deg = kJitter_deg / kDriftSteps;
  }
  return sensor;
}

// Frames of one sequence under one depth.
struct Stretch {
  std::string name;
  std::string depth;
  SequenceInfo info;
  std::uint64_t seed = 1;
  double voxel_m = 0.01;
  Segmentation segmentation = Segmentation::kGiven;
};

struct CameraRun {
  Given given = Given::kTrue;
  CameraSource source = CameraSource::kGiven;
  std::unique_ptr<Pipeline> pipeline;
  Trajectory given_T_WC;
};

// What all runs have.
struct CameraPlan {
  Method method = Method::kTsdfppAnchored;
  SdfTrackConfig settings;
};

std::vector<CameraRun> RunsOf(const Stretch& stretch, const CameraPlan& plan) {
  std::vector<CameraRun> runs;
  const auto add = [&](Given given, CameraSource source) {
    PipelineConfig config;
    config.method = plan.method;
    config.map.voxel_m = stretch.voxel_m;
    config.segmentation = stretch.segmentation;
    config.camera = source;
    config.track = plan.settings;
    CameraRun& run = runs.emplace_back();
    run.given = given;
    run.source = source;
    run.pipeline = std::make_unique<Pipeline>(config, stretch.info.objects);
  };
  for (const Given given : {Given::kTrue, Given::kDrift, Given::kJitter}) {
    add(given, CameraSource::kRefine);
  }
  add(Given::kTrue, CameraSource::kTrack);  // which does not read them
  return runs;
}

Expected<void> Feed(const Stretch& stretch, const Frame& frame, std::vector<CameraRun>& runs) {
  for (CameraRun& run : runs) {
    Frame given = frame;
    if (run.given != Given::kTrue && frame.index > stretch.info.first_index) {
      TSDFPP_ASSIGN(const SensedTruth ignored,
                    ApplySensor(PoseNoise(run.given), stretch.seed, stretch.info, given));
    }
    run.given_T_WC[frame.index] = given.T_WC;
    if (auto mapped = run.pipeline->Process(given); !mapped) {
      return tl::unexpected(std::move(mapped.error()));
    }
  }
  return {};
}

// Millimetres and degrees, RMSE over the frames.
std::string OffBy(const Trajectory& estimate, const Trajectory& truth) {
  const auto errors = PoseErrorsOf(PairByFrame(estimate, truth));
  if (!errors) return "-";
  return fmt::format("{:.1f} / {:.2f}", 1e3 * errors->translation_m.rmse,
                     errors->rotation_deg.rmse);
}

void Judge(const Stretch& stretch, const std::vector<CameraRun>& runs, const Trajectory& truth,
           FigureTable& table) {
  std::vector<std::string> row{stretch.name, stretch.depth,
                               fmt::format("{:g}", 1e3 * stretch.voxel_m)};
  for (const CameraRun& run : runs) {
    const CameraLog& log = run.pipeline->camera_log();
    std::string cell = OffBy(log.T_WC, truth);
    if (run.source == CameraSource::kRefine && run.given != Given::kTrue) {
      cell = fmt::format("{} to {}", OffBy(run.given_T_WC, truth), cell);
    }
    const int lost = log.carried_on + log.lost;
    if (lost > 0) cell += fmt::format(" ({} of {} not found)", lost, truth.size());
    row.push_back(std::move(cell));
  }
  std::printf("%s\n", fmt::format("{}", fmt::join(row, ", ")).c_str());
  std::fflush(stdout);
  table.Add(std::move(row));
}

// Frames of one sequence, and what is fed with each.
struct Stage {
  Stretch stretch;
  std::vector<CameraRun> runs;
};

Expected<void> RunScene(const CameraBenchOptions& options, const CameraPlan& plan,
                        const std::string& file, FigureTable& table) {
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(file));
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, {}));
  TSDFPP_ASSIGN(const SensorConfig noisy, SensorPresetNamed("nguyen2012"));
  const SequenceInfo& info = source->info();
  std::vector<Stage> stages;
  for (const char* depth : {"exact", "noise"}) {
    for (const double voxel_m : options.voxels_m) {
      Stretch stretch{info.name, depth, info, scene.seed, voxel_m};
      std::vector<CameraRun> runs = RunsOf(stretch, plan);
      stages.push_back({std::move(stretch), std::move(runs)});
    }
  }
  Trajectory truth;
  const int last = std::min(options.until, info.first_index + info.frame_count - 1);
  for (int index = info.first_index; index <= last; ++index) {
    TSDFPP_ASSIGN(const Frame exact, source->ReadTrue(index));
    Frame sensed = exact;
    TSDFPP_ASSIGN(const SensedTruth ignored, ApplySensor(noisy, scene.seed, info, sensed));
    truth[index] = exact.T_WC;
    for (Stage& stage : stages) {
      const Frame& frame = stage.stretch.depth == "exact" ? exact : sensed;
      TSDFPP_RETURN_IF_ERROR(Feed(stage.stretch, frame, stage.runs));
    }
  }
  for (const Stage& stage : stages) Judge(stage.stretch, stage.runs, truth, table);
  return {};
}

// What `refine` found from the poses as given, and `track`.
Expected<std::vector<FoundCamera>> RunRecording(const CameraBenchOptions& options,
                                                const CameraPlan& plan, double pose_offset_s,
                                                FrameSource& source, FigureTable& table) {
  const SequenceInfo& info = source.info();
  const std::string name = pose_offset_s == 0
                               ? info.name
                               : fmt::format("{} at {:+g} ms", info.name, 1e3 * pose_offset_s);
  const int last = std::min(options.until, info.first_index + info.frame_count - 1);
  std::vector<FoundCamera> found;
  for (const double voxel_m : options.voxels_m) {
    const Stretch stretch{name, "real", info, 1, voxel_m, Segmentation::kNone};
    std::vector<CameraRun> runs = RunsOf(stretch, plan);
    Trajectory truth;
    for (int index = info.first_index; index <= last; ++index) {
      TSDFPP_ASSIGN(const Frame frame, source.Read(index));
      truth[index] = frame.T_WC;
      TSDFPP_RETURN_IF_ERROR(Feed(stretch, frame, runs));
    }
    Judge(stretch, runs, truth, table);
    for (const CameraRun& run : runs) {
      if (run.given != Given::kTrue) continue;
      const char* source_name = run.source == CameraSource::kTrack ? "track" : "refine";
      found.push_back({fmt::format("`--camera {}` at {:g} mm", source_name, 1e3 * voxel_m),
                       run.pipeline->camera_log().T_WC});
    }
  }
  return found;
}

// The recording with each offset, and without one whose clock is right.
Expected<void> RunRecordings(const CameraBenchOptions& options, const CameraPlan& plan,
                             FigureTable& table) {
  SequenceOptions reading;
  TSDFPP_ASSIGN(const auto as_read, OpenSequence(options.recording, reading));
  const auto& [fx, fy, cx, cy] = options.camera;
  reading.intrinsics = {0, 0, fx, fy, cx, cy};
  for (const double offset_s : options.pose_offsets_s) {
    reading.pose_offset_s = offset_s;
    TSDFPP_ASSIGN(const auto source, OpenSequence(options.recording, reading));
    TSDFPP_ASSIGN(std::vector<FoundCamera> found,
                  RunRecording(options, plan, offset_s, *source, table));
    const fs::path folder = options.recording;
    if (offset_s == 0 && fs::exists(folder / "groundtruth.txt") &&
        fs::exists(folder / "depth.txt")) {
      TSDFPP_RETURN_IF_ERROR(JudgeClock(options.recording, *source, as_read->info().intrinsics,
                                        options.until, std::move(found), options.out));
    }
  }
  return {};
}

}  // namespace

Expected<void> RunCameraBench(const CameraBenchOptions& options) {
  CameraPlan plan;
  TSDFPP_ASSIGN(plan.method, MethodFromName(options.method));
  TSDFPP_RETURN_IF_ERROR(CheckCamera(plan.method, CameraSource::kTrack));
  if (!options.settings.empty()) {
    TSDFPP_ASSIGN(const toml::table settings, ParseTomlFile(options.settings));
    TSDFPP_ASSIGN(plan.settings, SdfTrackConfig::FromToml(settings, options.settings));
  }
  for (const double voxel_m : options.voxels_m) {
    MapConfig map;
    map.voxel_m = voxel_m;
    TSDFPP_RETURN_IF_ERROR(map.Validate());
  }
  FigureTable table({"sequence", "depth", "voxel mm", "true poses refined", "drift refined",
                     "jitter refined", "tracked"});
  for (const std::string& file : options.scenes) {
    TSDFPP_RETURN_IF_ERROR(RunScene(options, plan, file, table));
  }
  if (!options.recording.empty()) {
    TSDFPP_RETURN_IF_ERROR(RunRecordings(options, plan, table));
  }
  return table.Write(options.out, "camera");
}

}  // namespace tsdfpp
