#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <optional>
#include <set>
#include <string>

#include "cli/command.h"
#include "cli/map_start.h"
#include "cli/sequence_options.h"
#include "core/files.h"
#include "core/json_text.h"
#include "eval/picture/map_output.h"
#include "eval/picture/map_views.h"
#include "eval/run/open_source.h"
#include "eval/run/run_folder.h"
#include "mapper/index/voxel_list.h"
#include "mapper/kernels.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

struct MapArguments {
  SequenceArguments source;
  std::string method = "tsdf++/anchored";
  std::string segmentation;
  std::string associate;
  std::string poses = "gt";
  std::string track = "auto";
  std::string track_config;
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

// What is tracked, and how. A loaded map does not keep it, so it may be given again.
Expected<TrackWishes> ReadTracking(const MapArguments& options) {
  TrackWishes wishes;
  TSDFPP_ASSIGN(wishes.tracked, TrackChoiceFromName(options.track));
  if (options.track_config.empty()) return wishes;
  TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.track_config));
  TSDFPP_ASSIGN(wishes.config, SdfTrackConfig::FromToml(table, options.track_config));
  return wishes;
}

Expected<PipelineConfig> ConfigOf(const MapArguments& options) {
  PipelineConfig config;
  TSDFPP_ASSIGN(config.method, MethodFromName(options.method));
  TSDFPP_ASSIGN(config.poses, PoseSourceFromName(options.poses));
  TSDFPP_RETURN_IF_ERROR(CheckPoses(config.method, config.poses));
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
  wishes.poses = app.count("--poses") > 0;
  if (options.segmentation == "depth") {
    return UsageError(
        "--segmentation depth is not for map yet: its segments are not checked with --associate "
        "votes; expected gt or none; `tsdfpp segment` writes them");
  }
  if (!options.associate.empty()) {
    TSDFPP_ASSIGN(wishes.associate, AssociationModeFromName(options.associate));
  }
  if (!options.segmentation.empty()) {
    TSDFPP_ASSIGN(wishes.segmentation, SegmentationFromName(options.segmentation));
    if (options.source.path.empty()) {
      return UsageError("--segmentation {} needs a sequence to map", options.segmentation);
    }
  }
  TSDFPP_ASSIGN(wishes.track, ReadTracking(options));
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
  std::error_code failure;
  const auto place = std::filesystem::weakly_canonical(save, failure);
  const auto folder = std::filesystem::weakly_canonical(out, failure);
  const std::filesystem::path inside = place.lexically_relative(folder);
  if (failure || inside.empty() || *inside.begin() == "..") return false;
  const std::string first = inside.begin()->string();
  return first.starts_with('.') || kOwn.contains(first);
}

// Before anything is mapped, which may take long.
Expected<void> CheckOutputs(const MapArguments& options) {
  if (!options.remove.empty() && SplitList(options.remove).empty()) {
    return UsageError("--remove '{}' names no object", options.remove);
  }
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

// What was tracked, from when to when.
nlohmann::json TrackingJson(const Pipeline& pipeline, const SequenceInfo& info) {
  nlohmann::json objects = nlohmann::json::array();
  for (const auto& [id, span] : pipeline.track_log().objects()) {
    std::string name;
    for (const ObjectInfo& object : info.objects) {
      if (object.id == id) name = object.name;
    }
    objects.push_back({{"id", id},
                       {"name", name},
                       {"first_frame", span.first},
                       {"last_frame", span.last},
                       {"tracked_frames", span.tracked},
                       {"stayed_frames", span.stayed},
                       {"frozen_frames", span.frozen}});
  }
  return {{"which", TrackChoiceName(pipeline.tracked().choice())}, {"objects", objects}};
}

Expected<CommandResult> RunMap(const MapArguments& options, const CLI::App& app) {
  TSDFPP_ASSIGN(const MeshFormat mesh_format, MeshFormatFromName(options.mesh_format));
  TSDFPP_ASSIGN(const MapStart start, Start(options, app));
  SequenceInfo info = start.info;
  const PipelineConfig& config = start.config;
  Pipeline& pipeline = *start.pipeline;
  const bool votes = config.associate == AssociationMode::kVotes;
  std::vector<InstanceId> removed;
  // With votes the map's objects are known once it is made.
  if (!votes) {
    TSDFPP_ASSIGN(removed, FindObjects(info, SplitList(options.remove)));
  }
  if (!removed.empty() && !start.mask_remark.empty() && options.load.empty()) {
    return UsageError("--remove {} has nothing to remove: {}", options.remove, start.mask_remark);
  }
  if (!options.save.empty()) TSDFPP_RETURN_IF_ERROR(CheckCanBeSaved(pipeline.map()));
  if (!start.mask_remark.empty()) spdlog::warn("{}", start.mask_remark);
  if (config.poses != PoseSource::kGiven) {
    const bool all = pipeline.tracked().choice() == TrackChoice::kAll;
    spdlog::info("{}: tracked is {}", info.name,
                 all ? "all that is not background" : "what has a class");
  }
  if (votes) {
    spdlog::info("{}: the map's ids are its own, found by votes; poses are tracked ({})", info.name,
                 PoseSourceName(config.poses));
  }
  const int frames = start.last - start.first + 1;
  if (options.views > 0 && frames == 0) {
    return UsageError("--views {} needs a camera: name the sequence and map a frame of it",
                      options.views);
  }
  TSDFPP_RETURN_IF_ERROR(CheckOutputs(options));
  TSDFPP_ASSIGN(RunFolder run_folder, RunFolder::Begin(options.out, CommandText(app)));
  const std::filesystem::path& out = run_folder.path();
  std::set<std::string> files{"stats.json", fmt::format("mesh/scene.{}", options.mesh_format)};
  if (options.views > 0) files.insert("views/1");
  TSDFPP_RETURN_IF_ERROR(run_folder.CheckPlaces(std::move(files)));

  RunTimes times;
  Pose T_WC = Pose::Identity();  // of the last frame
  {
    ProgressBar bar("map");
    for (int index = start.first; index <= start.last; ++index) {
      TSDFPP_ASSIGN(const Frame frame, ReadToMap(start, index));
      TSDFPP_ASSIGN(const StepTimes step, pipeline.Process(frame));
      times.Add(step);
      T_WC = frame.T_WC;
      bar.Show(index - start.first + 1, frames);
    }
  }
  if (frames > 0 && start.mask_remark.empty() && config.poses == PoseSource::kGiven &&
      info.objects.size() > 1 && pipeline.trajectories().empty()) {
    spdlog::warn("{}: it holds no poses of objects, so all are mapped as standing still",
                 options.source.path);
  }
  const std::vector<std::string> remarks = pipeline.Remarks();
  for (const std::string& remark : remarks) spdlog::warn("{}: {}", info.name, remark);
  info.objects = ObjectsOf(start);
  if (votes) {
    TSDFPP_ASSIGN(removed, FindObjects(info, SplitList(options.remove)));
  }
  const std::unique_ptr<MapRepresentation> map = pipeline.map().Clone();
  for (const InstanceId id : removed) map->Remove(id);
  TSDFPP_RETURN_IF_ERROR(WriteMap(*map, pipeline, info, out, mesh_format));
  if (options.views > 0) {
    TSDFPP_RETURN_IF_ERROR(WriteViews(*map, info.intrinsics, T_WC, options.views, out / "views"));
  }
  const MapMemory memory = map->Memory();
  nlohmann::json stats{
      {"run", run_folder.id()},
      {"method", MethodName(config.method)},
      {"poses", PoseSourceName(config.poses)},
      {"segmentation", SegmentationName(config.segmentation)},
      {"associate", AssociationModeName(config.associate)},
      {"sequence", info.name},
      {"frames", frames},
      {"removed", removed},
      {"voxel_m", config.map.voxel_m},
      {"trunc_front_voxels", config.map.trunc_front_voxels},
      {"trunc_back_voxels", config.map.trunc_back_voxels},
      {"layers", LayersOf(config.method, config.map)},
      {"kernels", KernelsName(UsedKernels())},
      {"times", times.ToJson()},
      {"map", {{"blocks", memory.blocks}, {"bytes", memory.bytes}}},
  };
  if (config.poses != PoseSource::kGiven) stats["tracking"] = TrackingJson(pipeline, info);
  if (!start.mask_remark.empty()) stats["remarks"] = {start.mask_remark};
  for (const std::string& remark : remarks) stats["remarks"].push_back(remark);
  if (!options.load.empty()) stats["loaded"] = options.load;
  if (!options.save.empty()) {
    const MappedRun run = RunOf(start, start.last);
    TSDFPP_RETURN_IF_ERROR(SaveMap(options.save, *map, &run));
    std::error_code ignored;
    stats["saved"] = {{"file", options.save},
                      {"bytes", std::filesystem::file_size(options.save, ignored)}};
  }
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "stats.json", JsonText(stats, 2) + "\n"));
  TSDFPP_RETURN_IF_ERROR(run_folder.Commit());
  const std::string fusion = frames == 0
                                 ? ""
                                 : fmt::format("; fusion median {:.1f} ms a frame",
                                               stats["times"]["fuse"]["median_ms"].get<double>());
  return CommandResult{
      stats, fmt::format("{}: {} frames of {} mapped with {}; {} blocks, {:.1f} MB{}\n",
                         options.out, frames, info.name, MethodName(config.method), memory.blocks,
                         static_cast<double>(memory.bytes) / 1e6, fusion)};
}

}  // namespace

Run AddMap(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<MapArguments>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source)->required(false);
  app.add_option("--method", options->method,
                 MethodNames() + " (tsdfpp methods says what they are)")
      ->capture_default_str();
  app.add_option("--segmentation", options->segmentation,
                 "Where masks come from: gt (the sequence) or none (all is background); by default "
                 "gt where the sequence has masks")
      ->check(OneOf({"gt", "none", "depth"}));
  app.add_option("--associate", options->associate,
                 "Which objects segments are: given (the masks' ids) or votes (their points vote, "
                 "ids are the map's own; poses are then tracked); by default given unless ids are "
                 "drawn anew in every frame")
      ->check(OneOf({"given", "votes"}));
  app.add_option(
         "--poses", options->poses,
         "Object poses: gt (given), icp (tracked as in the paper), track (tracked by signed "
         "distances, docs/tracking.md)")
      ->capture_default_str();
  app.add_option("--track", options->track,
                 "Which objects are tracked: classified (those with a class), all (whatever is not "
                 "background), auto (classified where the sequence knows a class)")
      ->check(OneOf({"auto", "classified", "all"}))
      ->capture_default_str();
  app.add_option("--track-config", options->track_config,
                 "Settings of --poses track, a TOML file (docs/tracking.md)")
      ->check(NotEmpty("a file"));
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
                 "Objects to remove from the map at the end: ids or names, by commas");
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
