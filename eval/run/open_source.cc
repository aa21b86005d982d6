#include "eval/run/open_source.h"

#include <algorithm>
#include <iterator>

#include "sequence/open_sequence.h"
#include "sim/config/sensor_config.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {

Expected<std::unique_ptr<FrameSource>> OpenSource(const std::filesystem::path& scene_or_sequence,
                                                  const SequenceOptions& options,
                                                  SequenceNotes* notes, const SceneOptions& scene) {
  std::error_code code;
  if (scene_or_sequence.extension() == ".toml") {
    if (options.format || options.intrinsics || options.depth_units_per_m || options.fixed_camera ||
        options.pose_offset_s != 0 || !options.check) {
      return UsageError(
          "{}: is a scene; a format, a calibration, depth units, a fixed camera, an offset of "
          "poses or --unchecked are for sequences on disk",
          scene_or_sequence.string());
    }
    TSDFPP_ASSIGN(SceneConfig config, LoadSceneConfig(scene_or_sequence, scene.seed));
    if (!scene.sensor.empty()) {
      TSDFPP_ASSIGN(config.sensor, SensorPresetNamed(scene.sensor));
    }
    TSDFPP_ASSIGN(std::unique_ptr<SimulatedSource> source, SimulatedSource::Open(config, {}));
    return source;
  }
  if (!std::filesystem::exists(scene_or_sequence, code)) {
    return UsageError("{}: no such scene (a .toml file) or sequence (a folder)",
                      scene_or_sequence.string());
  }
  if (scene.IsAny()) {
    return UsageError("{}: is a sequence; a sensor and a seed are for scenes (.toml)",
                      scene_or_sequence.string());
  }
  return OpenSequence(scene_or_sequence, options, notes);
}

Expected<std::vector<InstanceId>> FindObjects(const SequenceInfo& info,
                                              const std::vector<std::string>& names_or_ids) {
  std::vector<InstanceId> ids;
  for (const std::string& wanted : names_or_ids) {
    const auto matches = [&](const ObjectInfo& object) {
      return object.name == wanted || std::to_string(object.id) == wanted;
    };
    const auto found = std::find_if(info.objects.begin(), info.objects.end(), matches);
    if (found == info.objects.end()) {
      std::string known;
      for (const ObjectInfo& object : info.objects) {
        known += fmt::format("{}{} ({})", known.empty() ? "" : ", ", object.name, object.id);
      }
      return UsageError("object '{}' is not in sequence {}, which has {}", wanted, info.name,
                        known);
    }
    const auto other = std::find_if(std::next(found), info.objects.end(), matches);
    if (other != info.objects.end()) {
      return UsageError("object '{}' may be {} ({}) or {} ({}) of sequence {}", wanted, found->name,
                        found->id, other->name, other->id, info.name);
    }
    if (std::ranges::count(ids, found->id) == 0) ids.push_back(found->id);
  }
  return ids;
}

std::string FileStem(const ObjectInfo& object) {
  return fmt::format("{}-{}", object.name, object.id);
}

}  // namespace tsdfpp
