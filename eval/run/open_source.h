// Frames from a scene file or a sequence on disk, whichever the path names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/frame_source.h"
#include "sequence/sequence_options.h"

namespace tsdfpp {

// What replaces a scene's own.
struct SceneOptions {
  std::string sensor{};  // a preset, or several joined by '+' (sim/config/sensor_config.h)
  std::optional<std::uint64_t> seed{};
  bool IsAny() const { return !sensor.empty() || seed.has_value(); }
};

// A .toml file is a scene and is rendered as `scene` has it; anything else is a sequence, opened
// with `options`. `notes`, where given, gets what its reader assumed or left out. Errors: kUsage
// where there is neither, where options for sequences meet a scene or those for scenes a sequence,
// else those of LoadSceneConfig, SensorPresetNamed, SimulatedSource and OpenSequence.
Expected<std::unique_ptr<FrameSource>> OpenSource(const std::filesystem::path& scene_or_sequence,
                                                  const SequenceOptions& options = {},
                                                  SequenceNotes* notes = nullptr,
                                                  const SceneOptions& scene = {});

// The ids that a list of ids or names stands for, each once. Errors: kUsage, naming the objects
// there are, or the two that one word may mean.
Expected<std::vector<InstanceId>> FindObjects(const SequenceInfo& info,
                                              const std::vector<std::string>& names_or_ids);

// "truck-1", as files are named after objects.
std::string FileStem(const ObjectInfo& object);

}  // namespace tsdfpp
