#include "eval/sweep/sweep_settings.h"

#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "mapper/index/voxel_list.h"
#include "sim/config/sensor_config.h"

namespace tsdfpp {
namespace {

using Settings = CellSettings;

tl::unexpected<Error> Wrong(const AxisValue& value, std::string_view expected) {
  const bool text = std::holds_alternative<std::string>(value);
  return UsageError("{}{}{}, expected {}", text ? "holds '" : "holds ", AxisText(value),
                    text ? "'" : "", expected);
}

// The error's sentence as a clause about a value that the axis holds.
tl::unexpected<Error> Because(const AxisValue& value, const Error& error) {
  return UsageError("holds '{}': {}", AxisText(value), error.message);
}

template <double Settings::*kField>
Expected<void> SetNumber(Settings& settings, const AxisValue& value, double low, double high) {
  const auto* number = std::get_if<double>(&value);
  if (number == nullptr || !(*number >= low && *number <= high)) {
    return Wrong(value, fmt::format("a number from {} to {}", low, high));
  }
  settings.*kField = *number;
  return {};
}

template <int Settings::*kField>
Expected<void> SetWhole(Settings& settings, const AxisValue& value, int low, int high) {
  const auto* number = std::get_if<double>(&value);
  if (number == nullptr || !(*number >= low && *number <= high) || std::floor(*number) != *number) {
    return Wrong(value, fmt::format("a whole number from {} to {}", low, high));
  }
  settings.*kField = static_cast<int>(*number);
  return {};
}

Expected<std::string> Text(const AxisValue& value, std::string_view expected) {
  const auto* text = std::get_if<std::string>(&value);
  if (text == nullptr || text->empty()) return Wrong(value, expected);
  return *text;
}

Expected<void> SetScene(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.scene, Text(value, "a scene file (.toml)"));
  return {};
}

Expected<void> SetSeed(Settings& settings, const AxisValue& value) {
  const auto* number = std::get_if<double>(&value);
  if (number == nullptr || !(*number >= 0 && *number <= static_cast<double>(kLargestSeed)) ||
      std::floor(*number) != *number) {
    return Wrong(value, "a whole number from 0 to 2^53");
  }
  settings.seed = static_cast<std::uint64_t>(*number);
  return {};
}

Expected<void> SetSensor(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.sensor, Text(value, "\"scene\" or the name of a sensor"));
  if (settings.sensor == "scene") return {};
  const auto preset = SensorPresetNamed(settings.sensor);
  return preset ? Expected<void>{} : Because(value, preset.error());
}

// The N of "open3d/N".
std::optional<double> Open3dBand_voxels(std::string_view method) {
  if (!method.starts_with(kOpen3dMethod)) return std::nullopt;
  method.remove_prefix(kOpen3dMethod.size());
  double voxels = 0;
  const auto [end, fault] = std::from_chars(method.begin(), method.end(), voxels);
  const bool whole = fault == std::errc() && end == method.end();
  return whole && voxels >= 1 && voxels <= 100 ? std::optional(voxels) : std::nullopt;
}

Expected<void> SetMethod(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(const std::string name, Text(value, "the name of a method"));
  if (name.starts_with("open3d")) {
    const auto voxels = Open3dBand_voxels(name);
    if (!voxels) return Wrong(value, "open3d/N, a band of N voxels on both sides, N from 1 to 100");
    settings.method = fmt::format("{}{}", kOpen3dMethod, *voxels);
    return {};
  }
  const auto method = MethodFromName(name);
  if (!method) return UsageError("{}, or {}N", method.error().message, kOpen3dMethod);
  settings.method = MethodName(*method);
  return {};
}

Expected<void> SetProfile(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.profile, Text(value, "paper or close"));
  MapConfig probe;
  const auto known = probe.SetProfile(settings.profile);
  return known ? known : Because(value, known.error());
}

Expected<void> SetPoses(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.poses, Text(value, "gt, icp or track"));
  const auto known = PoseSourceFromName(settings.poses);
  return known ? Expected<void>{} : Because(value, known.error());
}

Expected<void> SetSegmentation(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.segmentation, Text(value, "gt, depth or full"));
  const auto known = SegmentationFromName(settings.segmentation);
  if (!known) return Because(value, known.error());
  if (*known != Segmentation::kGiven && *known != Segmentation::kDepth &&
      *known != Segmentation::kFull) {
    return Wrong(value, "gt, depth or full");
  }
  return {};
}

Expected<void> SetResampling(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.resampling, Text(value, "all or observed"));
  const auto known = ResamplingFromName(settings.resampling);
  return known ? Expected<void>{} : Because(value, known.error());
}

Expected<void> SetMaskRepair(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.mask_repair, Text(value, "off or on"));
  const auto known = MaskRepairModeFromName(settings.mask_repair);
  return known ? Expected<void>{} : Because(value, known.error());
}

Expected<void> SetMovedVoxels(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.moved_voxels, Text(value, "all or near_surface"));
  const auto known = MovedVoxelsFromName(settings.moved_voxels);
  return known ? Expected<void>{} : Because(value, known.error());
}

Expected<void> SetRemovedVoxels(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(settings.removed_voxels, Text(value, "free or unobserved"));
  const auto known = RemovedVoxelsFromName(settings.removed_voxels);
  return known ? Expected<void>{} : Because(value, known.error());
}

Expected<void> SetSabotage(Settings& settings, const AxisValue& value) {
  TSDFPP_ASSIGN(const std::string name, Text(value, "none or the name of a sabotage"));
  const auto known = SabotageFromName(name);
  if (!known) return Because(value, known.error());
  settings.sabotage = *known;
  return {};
}

constexpr int kMost = std::numeric_limits<int>::max();

std::vector<Axis> MakeAxes() {
  using V = const AxisValue&;
  return {
      {"scene", SetScene, [](const Settings& s) -> AxisValue { return s.scene; }},
      {"seed", SetSeed, [](const Settings& s) -> AxisValue { return static_cast<double>(s.seed); }},
      {"sensor", SetSensor, [](const Settings& s) -> AxisValue { return s.sensor; }},
      {"noise", [](Settings& s, V v) { return SetNumber<&Settings::noise>(s, v, 0, 100); },
       [](const Settings& s) -> AxisValue { return s.noise; }},
      {"mask_faults",
       [](Settings& s, V v) { return SetNumber<&Settings::mask_faults>(s, v, 0, 100); },
       [](const Settings& s) -> AxisValue { return s.mask_faults; }},
      {"camera_error",
       [](Settings& s, V v) { return SetNumber<&Settings::camera_error>(s, v, 0, 1000); },
       [](const Settings& s) -> AxisValue { return s.camera_error; }},
      {"object_error",
       [](Settings& s, V v) { return SetNumber<&Settings::object_error>(s, v, 0, 1000); },
       [](const Settings& s) -> AxisValue { return s.object_error; }},
      {"speed", [](Settings& s, V v) { return SetWhole<&Settings::speed>(s, v, 1, 1000); },
       [](const Settings& s) -> AxisValue { return static_cast<double>(s.speed); }},
      {"objects", [](Settings& s, V v) { return SetWhole<&Settings::objects>(s, v, 0, 255); },
       [](const Settings& s) -> AxisValue { return static_cast<double>(s.objects); }},
      {"fuse_until",
       [](Settings& s, V v) { return SetWhole<&Settings::fuse_until>(s, v, 0, kMost); },
       [](const Settings& s) -> AxisValue { return static_cast<double>(s.fuse_until); }},
      {"method", SetMethod, [](const Settings& s) -> AxisValue { return s.method; }},
      {"profile", SetProfile, [](const Settings& s) -> AxisValue { return s.profile; }},
      {"trunc_front",
       [](Settings& s, V v) { return SetNumber<&Settings::trunc_front>(s, v, 1, 100); },
       [](const Settings& s) -> AxisValue { return s.trunc_front; }},
      {"trunc_back",
       [](Settings& s, V v) { return SetNumber<&Settings::trunc_back>(s, v, 1, 100); },
       [](const Settings& s) -> AxisValue { return s.trunc_back; }},
      {"voxel_m", [](Settings& s, V v) { return SetNumber<&Settings::voxel_m>(s, v, 0.0005, 1); },
       [](const Settings& s) -> AxisValue { return s.voxel_m; }},
      {"layers", [](Settings& s, V v) { return SetWhole<&Settings::layers>(s, v, 1, kMaxLayers); },
       [](const Settings& s) -> AxisValue { return static_cast<double>(s.layers); }},
      {"poses", SetPoses, [](const Settings& s) -> AxisValue { return s.poses; }},
      {"segmentation", SetSegmentation,
       [](const Settings& s) -> AxisValue { return s.segmentation; }},
      {"mask_repair", SetMaskRepair, [](const Settings& s) -> AxisValue { return s.mask_repair; }},
      {"resampling", SetResampling, [](const Settings& s) -> AxisValue { return s.resampling; }},
      {"moved_voxels", SetMovedVoxels,
       [](const Settings& s) -> AxisValue { return s.moved_voxels; }},
      {"removed_voxels", SetRemovedVoxels,
       [](const Settings& s) -> AxisValue { return s.removed_voxels; }},
      {"vote_band", [](Settings& s, V v) { return SetNumber<&Settings::vote_band>(s, v, 1, 100); },
       [](const Settings& s) -> AxisValue { return s.vote_band; }},
      {"sabotage", SetSabotage,
       [](const Settings& s) -> AxisValue { return std::string(SabotageName(s.sabotage)); }},
  };
}

}  // namespace

std::string AxisText(const AxisValue& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  return fmt::format("{}", std::get<double>(value));
}

nlohmann::json AxisJson(const AxisValue& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  const double number = std::get<double>(value);
  if (std::floor(number) == number) return static_cast<std::int64_t>(number);
  return number;
}

const std::vector<Axis>& Axes() {
  static const std::vector<Axis> axes = MakeAxes();
  return axes;
}

const Axis* FindAxis(std::string_view name) {
  for (const Axis& axis : Axes()) {
    if (axis.name == name) return &axis;
  }
  return nullptr;
}

Expected<PipelineConfig> CellSettings::Pipeline() const {
  PipelineConfig config;
  TSDFPP_RETURN_IF_ERROR(config.map.SetProfile(profile));
  if (const auto band_voxels = Open3dBand_voxels(method)) {
    config.map.trunc_front_voxels = *band_voxels;
    config.map.trunc_back_voxels = *band_voxels;
  } else {
    TSDFPP_ASSIGN(config.method, MethodFromName(method));
    if (trunc_front > 0) config.map.trunc_front_voxels = trunc_front;
    if (trunc_back > 0) config.map.trunc_back_voxels = trunc_back;
  }
  config.map.voxel_m = voxel_m;
  config.map.layers = layers;
  TSDFPP_ASSIGN(config.mask_repair, MaskRepairModeFromName(mask_repair));
  TSDFPP_ASSIGN(config.map.resampling, ResamplingFromName(resampling));
  TSDFPP_ASSIGN(config.map.moved_voxels, MovedVoxelsFromName(moved_voxels));
  TSDFPP_ASSIGN(config.map.removed_voxels, RemovedVoxelsFromName(removed_voxels));
  config.map.vote_band_voxels = vote_band;
  TSDFPP_ASSIGN(config.poses, PoseSourceFromName(poses));
  TSDFPP_RETURN_IF_ERROR(CheckPoses(config.method, config.poses));
  TSDFPP_RETURN_IF_ERROR(CheckMaskRepair(config.method, config.mask_repair));
  if (Open3dBand_voxels(method)) {
    if (config.mask_repair == MaskRepairMode::kOn) {
      return UsageError("method '{}' is given no masks that could be repaired, expected off",
                        method);
    }
    if (segmentation != CellSettings().segmentation) {
      return UsageError("method '{}' has no objects, expected segmentation gt, found {}", method,
                        segmentation);
    }
  }
  TSDFPP_ASSIGN(config.segmentation, SegmentationFromName(segmentation));
  if (IdsAreOfOneFrame(config.segmentation)) {
    if (config.poses == PoseSource::kGiven || !InfoOf(config.method).has_voxels) {
      return UsageError(
          "segmentation '{}' gives objects ids of its own: expected poses icp or track, and a "
          "method with voxels, found poses {} and method '{}'",
          segmentation, poses, method);
    }
    config.associate = AssociationMode::kVotes;
  }
  SabotageMap(sabotage, config);
  TSDFPP_RETURN_IF_ERROR(config.map.Validate());
  return config;
}

nlohmann::json SettingsJson(const CellSettings& settings) {
  nlohmann::json json;
  for (const Axis& axis : Axes()) json[axis.name] = AxisJson(axis.get(settings));
  return json;
}

Expected<CellSettings> SettingsFromJson(const nlohmann::json& json) {
  CellSettings settings;
  const CellSettings defaults;
  for (const Axis& axis : Axes()) {
    const auto found = json.is_object() ? json.find(axis.name) : json.end();
    if (!json.is_object() || found == json.end()) {
      return DataError("settings: '{}' is missing", axis.name);
    }
    if (!found->is_string() && !found->is_number()) {
      return DataError("settings: '{}' is neither a text nor a number", axis.name);
    }
    const AxisValue value =
        found->is_string() ? AxisValue(found->get<std::string>()) : AxisValue(found->get<double>());
    // A default may be what cannot be asked for: 0 for "as the method or the profile has it".
    if (value == axis.get(defaults)) continue;
    if (auto set = axis.set(settings, value); !set) {
      return DataError("settings: '{}' {}", axis.name, set.error().message);
    }
  }
  return settings;
}

std::string MapKey(const CellSettings& settings) {
  const PipelineConfig config = *settings.Pipeline();
  const bool sabotaged = settings.sabotage != Sabotage::kNone && !IsOfSequence(settings.sabotage);
  const std::string sabotage =
      sabotaged ? fmt::format(" sabotage {}", SabotageName(settings.sabotage)) : "";
  if (settings.is_open3d()) {
    return fmt::format("open3d voxel_m {} truncation_voxels {}{}", config.map.voxel_m,
                       config.map.trunc_front_voxels, sabotage);
  }
  const MethodInfo& info = InfoOf(config.method);
  if (!info.has_voxels) {
    return fmt::format("{} voxel_m {} poses {}{}", info.name, config.map.voxel_m,
                       PoseSourceName(config.poses), sabotage);
  }
  return fmt::format(
      "{} voxel_m {} front {} back {} layers {} poses {}{}{}{}{}{}", info.name, config.map.voxel_m,
      config.map.trunc_front_voxels, config.map.trunc_back_voxels,
      LayersOf(config.method, config.map), PoseSourceName(config.poses),
      config.segmentation == Segmentation::kGiven
          ? ""
          : fmt::format(" segmentation {}", SegmentationName(config.segmentation)),
      config.mask_repair == MaskRepairMode::kOn ? " mask_repair on" : "",
      info.moves_values ? fmt::format(" resampling {}", ResamplingName(config.map.resampling)) : "",
      IsOneField(config.method)
          ? fmt::format(" moved_voxels {} removed_voxels {} vote_band {}",
                        MovedVoxelsName(config.map.moved_voxels),
                        RemovedVoxelsName(config.map.removed_voxels), config.map.vote_band_voxels)
          : "",
      sabotage);
}

}  // namespace tsdfpp
