#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cli/command.h"
#include "cli/map_start.h"
#include "cli/map_stats.h"
#include "cli/pose_choice.h"
#include "cli/segmentation_options.h"
#include "cli/sequence_options.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "eval/picture/map_output.h"
#include "eval/picture/map_views.h"
#include "eval/run/open_source.h"
#include "eval/run/run_folder.h"
#include "mapper/index/voxel_list.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

struct MapArguments {
  SequenceArguments source;
  std::string method = "tsdf++/anchored";
  SegmentationOptions segmentation;
  std::string associate;
  std::string votes;
  std::string camera = "gt";
  std::string bleeding = "auto";
  RepairOptions repair;
  std::string poses;
  TrackingOptions tracking;  // a loaded map does not keep it, so it may be given again
  std::string profile = "close";
  std::string remove;
  std::string out;
  std::string load;
  std::string save;
  std::string mesh_format = "ply";
  MapConfig map;
  double trunc_front = 0;
  double trunc_back = 0;
  int until = -1;
  int views = 0;
};

// Settings that a loaded map has already.
constexpr std::array<const char*, 8> kSettingsOfTheMap = {
    "--method", "--profile", "--trunc-front", "--trunc-back",
    "--layers", "--voxel",   "--poses",       "--associate"};

Expected<PipelineConfig> ConfigOf(const MapArguments& options) {
  PipelineConfig config;
  TSDFPP_ASSIGN(config.method, MethodFromName(options.method));
  config.map = options.map;
  TSDFPP_RETURN_IF_ERROR(config.map.SetProfile(options.profile));
  if (options.trunc_front > 0) config.map.trunc_front_voxels = options.trunc_front;
  if (options.trunc_back > 0) config.map.trunc_back_voxels = options.trunc_back;
  if (options.map.layers != 0 && LayersOf(config.method, config.map) != options.map.layers) {
    return UsageError("--layers {} does not fit method {}, whose number of layers is fixed",
                      options.map.layers, options.method);
  }
  if (!InfoOf(config.method).has_voxels && (options.trunc_front > 0 || options.trunc_back > 0)) {
    return UsageError(
        "--trunc-front and --trunc-back do not fit method {}, which has no truncation",
        options.method);
  }
  TSDFPP_RETURN_IF_ERROR(config.map.Validate());
  return config;
}

Expected<MapStart> Start(const MapArguments& options, const CLI::App& app) {
  MapWishes wishes;
  if (!options.poses.empty()) {
    TSDFPP_ASSIGN(wishes.poses, PoseSourceFromName(options.poses));
  }
  TSDFPP_ASSIGN(wishes.camera, CameraSourceFromName(options.camera));
  TSDFPP_ASSIGN(wishes.bleeding, BleedingPixelsFromName(options.bleeding));
  TSDFPP_ASSIGN(wishes.repair, ReadRepair(options.repair));
  if (!options.associate.empty()) {
    TSDFPP_ASSIGN(wishes.associate, AssociationModeFromName(options.associate));
  }
  TSDFPP_ASSIGN(wishes.votes, ReadVotes(options.votes));
  if (const std::string& name = options.segmentation.segmentation; !name.empty()) {
    TSDFPP_ASSIGN(wishes.segmentation, SegmentationFromName(name));
    if (options.source.path.empty()) {
      return UsageError("--segmentation {} needs a sequence to map", name);
    }
  }
  TSDFPP_ASSIGN(wishes.segmenter, ReadSegmenterParts(options.segmentation, wishes.segmentation));
  TSDFPP_ASSIGN(wishes.track, ReadTracking(options.tracking));
  if (options.load.empty()) {
    if (options.source.path.empty()) {
      return UsageError("SCENE-or-SEQ is missing: what to map, or --load FILE (see --help)");
    }
    TSDFPP_ASSIGN(const PipelineConfig config, ConfigOf(options));
    return StartNew(config, options.source, wishes, options.until);
  }
  for (const char* option : kSettingsOfTheMap) {
    if (app.count(option) > 0) {
      return UsageError("{} cannot be given with --load, whose map has its own", option);
    }
  }
  return StartLoaded(options.load, options.source, wishes, options.until);
}

// Whether the file is, or lies below, what the run itself writes to its folder.
bool IsOfTheRun(const std::filesystem::path& save, const std::filesystem::path& out) {
  static const std::set<std::string> kOwn{"mesh", "trajectories", "views", "stats.json", kRunNote};
  const std::filesystem::path inside = TruePath(save).lexically_relative(TruePath(out));
  if (inside.empty() || *inside.begin() == "..") return false;
  const std::string first = inside.begin()->string();
  return first.starts_with('.') || kOwn.contains(first);
}

// What a run reads: files, and folders as a whole. The map of --load may take its own place.
std::vector<std::filesystem::path> ReadBeside(const MapArguments& options) {
  std::vector<std::filesystem::path> places = PlacesOf(options.source);
  const std::vector<std::filesystem::path> of_segments = options.segmentation.Places();
  places.insert(places.end(), of_segments.begin(), of_segments.end());
  places.insert(places.end(), {options.votes, options.repair.config, options.tracking.config});
  return places;
}

Expected<void> CheckSaveReplacesNothingRead(const MapArguments& options) {
  if (options.save.empty()) return {};
  for (const std::filesystem::path& read : ReadBeside(options)) {
    if (!LiesIn(options.save, read)) continue;
    return UsageError("--save '{}' lies in '{}', which is read, expected another place",
                      options.save, read.string());
  }
  return {};
}

// Before anything is mapped, which may take long.
Expected<void> CheckOutputs(const MapArguments& options, int frames) {
  if (options.views > 0 && frames == 0) {
    return UsageError("--views {} needs a camera: name the sequence and map a frame of it",
                      options.views);
  }
  TSDFPP_RETURN_IF_ERROR(NamesOf("--remove", options.remove));
  if (IsOurSequence(options.out)) {
    return UsageError("--out '{}' is a sequence, expected another folder", options.out);
  }
  if (options.save.empty()) return {};
  const std::filesystem::path save(options.save);
  std::error_code ignored;
  if (std::filesystem::is_directory(save, ignored)) {
    return UsageError("--save '{}' is a folder, expected a file", options.save);
  }
  if (std::filesystem::exists(save, ignored) && !std::filesystem::is_regular_file(save, ignored)) {
    return UsageError("--save '{}' is a device or a pipe, expected a file or nothing",
                      options.save);
  }
  if (IsOfTheRun(save, options.out)) {
    return UsageError("--save '{}' is a place of what --out '{}' gets, expected another",
                      options.save, options.out);
  }
  return save.has_parent_path() ? MakeWritableFolder(save.parent_path()) : Expected<void>{};
}

// Before the sequence's frames are read: whether its map can have removed and saved what is asked.
Expected<void> CheckStart(const MapArguments& options, const MapStart& start,
                          const std::vector<InstanceId>& removed) {
  if (!removed.empty() && !start.mask_remark.empty() && options.load.empty()) {
    return UsageError("--remove {} has nothing to remove: {}", options.remove, start.mask_remark);
  }
  if (options.save.empty()) return {};
  if (start.last > kGreatestSavedFrame) {
    return UsageError("--save '{}': the last frame to map is {}, expected at most {} (--until)",
                      options.save, start.last, kGreatestSavedFrame);
  }
  return CheckCanBeSaved(start.pipeline->map());
}

void LogStart(const MapStart& start) {
  if (!start.mask_remark.empty()) spdlog::warn("{}", start.mask_remark);
  if (start.config.poses != PoseSource::kGiven) {
    spdlog::info("{}: tracked is {}", start.info.name,
                 TrackChoiceText(start.pipeline->tracked().choice()));
  }
  if (!start.pose_remark.empty()) spdlog::info("{}", start.pose_remark);
  for (const std::string& remark : start.load_remarks) spdlog::warn("{}", remark);
  if (start.by_votes()) {
    spdlog::info("{}: the map's ids are its own, found by votes; poses are tracked ({})",
                 start.info.name, PoseSourceName(start.config.poses));
  }
}

Expected<RunFolder> BeginRun(const MapArguments& options, const MapStart& start,
                             const CLI::App& app) {
  TSDFPP_ASSIGN(RunFolder folder, RunFolder::Begin(options.out, CommandText(app)));
  std::set<std::string> files{"stats.json", fmt::format("mesh/scene.{}", options.mesh_format),
                              "trajectories/camera.txt"};
  // With votes the map's objects are known once it is made.
  if (!start.by_votes()) {
    for (const ObjectInfo& object : start.info.objects) {
      files.insert(fmt::format("mesh/{}.{}", FileStem(object), options.mesh_format));
      files.insert(fmt::format("trajectories/{}.txt", FileStem(object)));
    }
  }
  for (const std::string& view : ViewFiles(options.views)) files.insert("views/" + view);
  TSDFPP_RETURN_IF_ERROR(folder.CheckPlaces(files));
  return folder;
}

struct MappedFrames {
  RunTimes times;
  std::optional<std::uint64_t> last_depth;  // HashOfDepth()
  // Of the last frame whose camera is known, if there is one.
  Intrinsics intrinsics;
  std::optional<Pose> T_WC;
};

Expected<MappedFrames> MapFrames(const MapStart& start) {
  MappedFrames mapped;
  mapped.intrinsics = start.info.intrinsics;
  if (const auto& place = start.pipeline->camera_place()) mapped.T_WC = place->T_WC;
  ProgressBar bar("map");
  for (int index = start.first; index <= start.last; ++index) {
    TSDFPP_ASSIGN(const Frame frame, ReadToMap(start, index));
    TSDFPP_ASSIGN(const StepTimes step, start.pipeline->Process(frame));
    mapped.times.Add(step);
    const auto& located = start.pipeline->camera_log().T_WC;
    const bool is_given = start.config.camera == CameraSource::kGiven;
    if (is_given || located.contains(frame.index)) {
      mapped.intrinsics = frame.intrinsics;
      mapped.T_WC = is_given ? frame.T_WC : located.at(frame.index);
    }
    if (index == start.last) mapped.last_depth = HashOfDepth(frame);
    bar.Show(index - start.first + 1, start.frames());
  }
  return mapped;
}

void LogRemarks(const MapArguments& options, const MapStart& start) {
  if (start.frames() > 0 && start.mask_remark.empty() && start.config.poses == PoseSource::kGiven &&
      start.info.objects.size() > 1 && start.pipeline->trajectories().empty()) {
    spdlog::warn("{}: it holds no poses of objects, so all are mapped as standing still",
                 options.source.path);
  }
  for (const std::string& remark : start.pipeline->Remarks()) {
    spdlog::warn("{}: {}", start.info.name, remark);
  }
}

// Writes the map, after the removals, to --save, and says so.
Expected<nlohmann::json> Save(const MapArguments& options, const MapStart& start,
                              const MappedFrames& mapped, const MapRepresentation& map) {
  const MappedRun run = RunOf(start, start.last, mapped.last_depth);
  TSDFPP_RETURN_IF_ERROR(SaveMap(options.save, map, &run));
  std::error_code ignored;
  return nlohmann::json{{"file", options.save},
                        {"bytes", std::filesystem::file_size(options.save, ignored)}};
}

CommandResult ResultOf(const MapArguments& options, const MapStart& start, nlohmann::json stats) {
  const std::string fusion = start.frames() == 0
                                 ? ""
                                 : fmt::format("; fusion median {:.1f} ms a frame",
                                               stats["times"]["fuse"]["median_ms"].get<double>());
  std::string line = fmt::format(
      "{}: {} frames of {} mapped with {}; {} blocks, {:.1f} MB{}\n", options.out, start.frames(),
      start.info.name, MethodName(start.config.method), stats["map"]["blocks"].get<std::size_t>(),
      stats["map"]["bytes"].get<double>() / 1e6, fusion);
  return {std::move(stats), std::move(line)};
}

Expected<CommandResult> RunMap(const MapArguments& options, const CLI::App& app) {
  TSDFPP_ASSIGN(const MeshFormat mesh_format, MeshFormatFromName(options.mesh_format));
  TSDFPP_RETURN_IF_ERROR(CheckSaveReplacesNothingRead(options));
  TSDFPP_ASSIGN(const MapStart start, Start(options, app));
  std::vector<InstanceId> removed;
  // With votes the map's objects are known once it is made.
  if (!start.by_votes()) {
    TSDFPP_ASSIGN(removed, FindObjects(start.info, SplitList(options.remove)));
  }
  TSDFPP_RETURN_IF_ERROR(CheckStart(options, start, removed));
  LogStart(start);
  TSDFPP_RETURN_IF_ERROR(CheckOutputs(options, start.frames()));
  TSDFPP_ASSIGN(RunFolder run_folder, BeginRun(options, start, app));
  const std::filesystem::path& out = run_folder.path();

  TSDFPP_ASSIGN(const MappedFrames mapped, MapFrames(start));
  LogRemarks(options, start);
  SequenceInfo info = start.info;
  info.objects = ObjectsOf(start);
  if (start.by_votes()) {
    TSDFPP_ASSIGN(removed, FindObjects(info, SplitList(options.remove)));
  }
  const std::unique_ptr<MapRepresentation> map = start.pipeline->map().Clone();
  for (const InstanceId id : removed) map->Remove(id);

  TSDFPP_RETURN_IF_ERROR(WriteMap(*map, *start.pipeline, info, out, mesh_format));
  if (options.views > 0 && mapped.T_WC) {
    TSDFPP_RETURN_IF_ERROR(
        WriteViews(*map, mapped.intrinsics, *mapped.T_WC, options.views, out / "views"));
  } else if (options.views > 0) {
    spdlog::warn("--views {}: writes none, as the camera was found in no frame", options.views);
  }
  nlohmann::json stats = StatsOf(start, mapped.times, removed, map->Memory());
  stats["run"] = run_folder.id();
  if (!options.load.empty()) stats["loaded"] = options.load;
  if (!options.save.empty()) {
    TSDFPP_ASSIGN(stats["saved"], Save(options, start, mapped, *map));
  }
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "stats.json", JsonText(stats, 2) + "\n"));
  // Which objects have files is known only now.
  TSDFPP_RETURN_IF_ERROR(run_folder.CheckPlaces());
  TSDFPP_RETURN_IF_ERROR(run_folder.Commit());
  return ResultOf(options, start, std::move(stats));
}

}  // namespace

Run AddMap(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<MapArguments>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source)->required(false);
  app.add_option("--method", options->method,
                 MethodNames() + " (tsdfpp methods says what they are)")
      ->capture_default_str();
  AddSegmentationOptions(app,
                         "Where masks come from, by default the sequence if it has any: gt (the "
                         "sequence), none (all is background),",
                         options->segmentation);
  AddDepthConfigOption(app, options->segmentation);
  app.add_option("--associate", options->associate,
                 "Which objects segments are: given (the masks' ids) or votes (their points vote, "
                 "ids are the map's own; poses are then tracked); by default given unless ids are "
                 "drawn anew in every frame")
      ->check(OneOf({"given", "votes"}));
  AddVoteOption(app, options->votes);
  app.add_option("--bleeding", options->bleeding,
                 "Pixels beside an outline with the depth of its other side: keep (mapped like "
                 "others), wait (left out of the frame), auto (wait where objects or the camera "
                 "are tracked by signed distances)")
      ->check(OneOf({"auto", "keep", "wait"}))
      ->capture_default_str();
  AddRepairOptions(app, options->repair);
  app.add_option("--camera", options->camera,
                 "Camera poses: gt (given), refine (given and then corrected by the map's "
                 "background), track (the first one given, the others found by it)")
      ->check(OneOf({"gt", "refine", "track"}))
      ->capture_default_str();
  app.add_option("--poses", options->poses,
                 std::string("Object poses: gt (given), icp (tracked as in the paper), track "
                             "(tracked by signed distances, docs/tracking.md); ") +
                     kDefaultPosesHelp)
      ->check(NotEmpty("gt, icp or track"));
  AddTrackingOptions(app, options->tracking);
  app.add_option("--profile", options->profile,
                 "Truncation: paper (10 voxels in front, 10 behind) or close (10, 3)")
      ->capture_default_str();
  app.add_option("--trunc-front", options->trunc_front, "Truncation in front, voxels")
      ->check(AboveZero());
  app.add_option("--trunc-back", options->trunc_back, "Truncation behind, voxels")
      ->check(AboveZero());
  app.add_option("--layers", options->map.layers, "Objects a voxel lists (K)")->check(AboveZero());
  app.add_option("--voxel", options->map.voxel_m, "Voxel size, metres")->capture_default_str();
  app.add_option("--until", options->until, "Last frame to map")->check(NotNegative());
  app.add_option("--remove", options->remove,
                 "Objects to remove from the map at the end: ids or names, by commas")
      ->check(NotEmpty("ids or names"));
  app.add_option("--mesh-format", options->mesh_format,
                 "Meshes as ply or as glb (binary glTF, with names and a node an object)")
      ->capture_default_str();
  app.add_option("--views", options->views,
                 "Surfaces along each ray of the last camera to write as pictures: 1 is what is "
                 "visible, 2 adds what is behind it")
      ->check(WholeBetween(0, kMaxLayers));
  app.add_option(
         "--load", options->load,
         "Begin with the map in this file: with a sequence, go on after the map's last frame; "
         "without, write its meshes")
      ->check(NotEmpty("a file"));
  app.add_option("--save", options->save, "Write the whole map, after the removals, to this file")
      ->check(NotEmpty("a file"));
  app.add_option("--out", options->out, "Output folder")->check(NotEmpty("a folder"))->required();
  return [options, &app] { return RunMap(*options, app); };
}

}  // namespace tsdfpp
