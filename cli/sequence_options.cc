#include "cli/sequence_options.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <limits>

#include "cli/command.h"
#include "core/data_folder.h"
#include "core/folders.h"
#include "sequence/calibration.h"
#include "sequence/open_sequence.h"
#include "sim/load_scene.h"
#include "sim/scene/scene_inputs.h"

namespace tsdfpp {
namespace {

// Clocks that are further apart belong to different recordings.
constexpr double kMostPoseOffset_s = 10;

}  // namespace

CLI::Option* AddSequenceArguments(CLI::App& app, const std::string& name,
                                  SequenceArguments& arguments) {
  CLI::Option* path =
      app.add_option(name, arguments.path, "Sequence (folder or .klg) or scene (.toml)");
  path->required();
  std::vector<std::string> formats;
  for (const DatasetFormat format : AllDatasetFormats()) {
    formats.emplace_back(DatasetFormatName(format));
  }
  app.add_option("--dataset", arguments.dataset,
                 "The sequence's format, where it is not to be detected")
      ->check(OneOf(formats));
  app.add_option("--calibration", arguments.calibration,
                 "File with fx fy cx cy [width height] in place of the sequence's own; a negative "
                 "fy is an image whose y axis points up");
  app.add_option("--depth-units", arguments.depth_units,
                 "Depth values in one metre, in place of the format's")
      ->check(AboveZero());
  app.add_flag("--fixed-camera", arguments.fixed_camera,
               "Take a camera without poses on disk as one that does not move");
  app.add_option("--pose-offset", arguments.pose_offset_s,
                 "Seconds to add to an image's time before its camera pose is looked up in "
                 "groundtruth.txt, for clocks that do not agree (tum, klg)")
      ->check(Between(-kMostPoseOffset_s, kMostPoseOffset_s));
  app.add_flag("--unchecked", arguments.unchecked,
               "Do not look for wrong units and inverted poses");
  app.add_option("--sensor", arguments.scene.sensor,
                 "Of a scene: a ready-made sensor in place of its own, or several joined by '+' "
                 "(docs/sensors.md)")
      ->check(NotEmpty("the name of a sensor"));
  app.add_option("--seed", arguments.scene.seed,
                 "Of a scene: replaces its seed, of random scenes, jitter, sensor")
      ->check(WholeBetween(0, std::numeric_limits<std::int64_t>::max()));
  AddFollowLinks(app);
  return path;
}

const char* SequenceArguments::Option() const {
  if (!dataset.empty()) return "--dataset";
  if (!calibration.empty()) return "--calibration";
  if (depth_units > 0) return "--depth-units";
  if (fixed_camera) return "--fixed-camera";
  if (pose_offset_s != 0) return "--pose-offset";
  if (unchecked) return "--unchecked";
  return nullptr;
}

std::string TextOf(const SequenceArguments& arguments) {
  std::string text = arguments.path;
  if (!arguments.dataset.empty()) text += " --dataset " + arguments.dataset;
  if (!arguments.calibration.empty()) text += " --calibration " + arguments.calibration;
  if (arguments.depth_units > 0) text += fmt::format(" --depth-units {}", arguments.depth_units);
  if (arguments.fixed_camera) text += " --fixed-camera";
  if (arguments.pose_offset_s != 0) {
    text += fmt::format(" --pose-offset {}", arguments.pose_offset_s);
  }
  if (arguments.unchecked) text += " --unchecked";
  if (!arguments.scene.sensor.empty()) text += " --sensor " + arguments.scene.sensor;
  if (arguments.scene.seed) text += fmt::format(" --seed {}", *arguments.scene.seed);
  if (CurrentLinkPolicy() == LinkPolicy::kAnywhere) text += " --follow-links";
  return text;
}

std::vector<std::filesystem::path> PlacesOf(const SequenceArguments& arguments) {
  std::vector<std::filesystem::path> places;
  const std::filesystem::path path = arguments.path;
  if (!arguments.calibration.empty()) places.emplace_back(arguments.calibration);
  if (!IsThere(path)) return places;
  places.push_back(path);
  std::vector<std::filesystem::path> others = PlacesBeside(path);
  if (path.extension() == ".toml") {
    // Of one that cannot be read, opening it says so.
    if (const auto scene = LoadSceneConfig(path, arguments.scene.seed)) others = ListInputs(*scene);
  }
  places.insert(places.end(), others.begin(), others.end());
  return places;
}

Expected<std::unique_ptr<FrameSource>> OpenArguments(const SequenceArguments& arguments) {
  SequenceOptions options;
  if (!arguments.dataset.empty()) {
    TSDFPP_ASSIGN(options.format, DatasetFormatFromName(arguments.dataset));
  }
  if (!arguments.calibration.empty()) {
    std::error_code code;
    if (!std::filesystem::exists(arguments.calibration, code)) {
      return UsageError("--calibration {}: no such file", arguments.calibration);
    }
    TSDFPP_ASSIGN(options.intrinsics, ReadSignedCalibration(arguments.calibration));
  }
  if (arguments.depth_units > 0) options.depth_units_per_m = arguments.depth_units;
  options.fixed_camera = arguments.fixed_camera;
  options.pose_offset_s = arguments.pose_offset_s;
  options.check = !arguments.unchecked;
  SequenceNotes notes;
  TSDFPP_ASSIGN(auto source, OpenSource(arguments.path, options, &notes, arguments.scene));
  for (const std::string& note : notes) spdlog::info(note);
  return source;
}

Expected<MaskedSource> OpenForScores(const SequenceArguments& arguments) {
  TSDFPP_ASSIGN(auto source, OpenArguments(arguments));
  // A scene has masks, and a frame of it takes long to render.
  if (std::filesystem::path(arguments.path).extension() == ".toml") {
    return MaskedSource{std::move(source), ""};
  }
  TSDFPP_ASSIGN(MaskedSource masked, WithBackgroundMasks(std::move(source)));
  const std::size_t objects = masked.source->info().objects.size();
  if (!masked.remark.empty() && objects > 1) {
    return DataError(
        "{}: has no masks, expected one for each frame: scores of its {} objects need them; "
        "`tsdfpp map` maps it as background",
        arguments.path, objects - 1);
  }
  if (!masked.remark.empty()) spdlog::warn("{}", masked.remark);
  return masked;
}

}  // namespace tsdfpp
