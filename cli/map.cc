#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "cli/command.h"
#include "cli/sequence_options.h"
#include "core/files.h"
#include "eval/map_output.h"
#include "eval/open_source.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

struct Options {
  SequenceArguments source;
  std::string method = "tsdf++/anchored";
  std::string segmentation = "gt";
  std::string poses = "gt";
  std::string profile = "close";
  std::string remove;
  std::string out;
  std::string mesh_format = "ply";
  MapConfig map;
  double trunc_front = 0;
  double trunc_back = 0;
  int until = -1;
};

Expected<CommandResult> RunMap(const Options& options) {
  PipelineConfig config;
  TSDFPP_ASSIGN(config.method, MethodFromName(options.method));
  TSDFPP_ASSIGN(config.poses, PoseSourceFromName(options.poses));
  TSDFPP_ASSIGN(const MeshFormat mesh_format, MeshFormatFromName(options.mesh_format));
  config.map = options.map;
  TSDFPP_RETURN_IF_ERROR(config.map.SetProfile(options.profile));
  if (options.trunc_front > 0) config.map.trunc_front_voxels = options.trunc_front;
  if (options.trunc_back > 0) config.map.trunc_back_voxels = options.trunc_back;
  if (options.map.layers != 0 && LayersOf(config.method, config.map) != options.map.layers) {
    return UsageError("--layers {} does not fit method {}, whose number of layers is fixed",
                      options.map.layers, options.method);
  }
  TSDFPP_RETURN_IF_ERROR(config.map.Validate());

  TSDFPP_ASSIGN(auto source, OpenArguments(options.source));
  const SequenceInfo& info = source->info();
  const int last = info.first_index + info.frame_count - 1;
  const int until = options.until < 0 ? last : options.until;
  if (until < info.first_index || until > last) {
    return UsageError("--until {} is out of range: {} has frames {} to {}", until, info.name,
                      info.first_index, last);
  }
  TSDFPP_ASSIGN(const auto removed, FindObjects(info, SplitList(options.remove)));
  if (IsOurSequence(options.out)) {
    return UsageError("--out '{}' is a sequence, expected another folder", options.out);
  }
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(options.out));

  Pipeline pipeline(config, info.objects);
  RunTimes times;
  {
    ProgressBar bar("map");
    for (int index = info.first_index; index <= until; ++index) {
      TSDFPP_ASSIGN(const Frame frame, source->Read(index));
      if (frame.mask.empty()) {
        return DataError("{}: frame {} has no mask, which --segmentation gt needs",
                         options.source.path, index);
      }
      times.Add(pipeline.Process(frame));
      bar.Show(index - info.first_index + 1, until - info.first_index + 1);
    }
  }
  if (config.poses == PoseSource::kGiven && info.objects.size() > 1 &&
      pipeline.trajectories().empty()) {
    spdlog::warn("{}: it holds no poses of objects, so all are mapped as standing still",
                 options.source.path);
  }
  const std::unique_ptr<MapRepresentation> map = pipeline.map().Clone();
  for (const InstanceId id : removed) map->Remove(id);
  TSDFPP_RETURN_IF_ERROR(WriteMap(*map, pipeline, info, options.out, mesh_format));
  const MapMemory memory = map->Memory();
  const nlohmann::json stats{
      {"method", MethodName(config.method)},
      {"poses", PoseSourceName(config.poses)},
      {"segmentation", options.segmentation},
      {"sequence", info.name},
      {"frames", until - info.first_index + 1},
      {"removed", removed},
      {"voxel_m", config.map.voxel_m},
      {"trunc_front_voxels", config.map.trunc_front_voxels},
      {"trunc_back_voxels", config.map.trunc_back_voxels},
      {"layers", LayersOf(config.method, config.map)},
      {"times", times.ToJson()},
      {"map", {{"blocks", memory.blocks}, {"bytes", memory.bytes}}},
  };
  TSDFPP_RETURN_IF_ERROR(
      WriteFile(std::filesystem::path(options.out) / "stats.json", stats.dump(2) + "\n"));
  return CommandResult{
      stats, fmt::format("{}: {} frames of {} mapped with {}; {} blocks, {:.1f} MB; fusion median "
                         "{:.1f} ms a frame\n",
                         options.out, stats["frames"].get<int>(), info.name, options.method,
                         memory.blocks, static_cast<double>(memory.bytes) / 1e6,
                         stats["times"]["fuse"]["median_ms"].get<double>())};
}

}  // namespace

Run AddMap(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<Options>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source);
  app.add_option("--method", options->method,
                 "tsdf, tsdf/min, tsdf++, tsdf++/literal, tsdf++/anchored")
      ->capture_default_str();
  app.add_option("--segmentation", options->segmentation, "Where masks come from")
      ->check(CLI::IsMember({"gt"}))
      ->capture_default_str();
  app.add_option("--poses", options->poses, "Object poses: gt (given) or icp (tracked)")
      ->capture_default_str();
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
  app.add_option("--out", options->out, "Output folder")->required();
  return [options] { return RunMap(*options); };
}

}  // namespace tsdfpp
