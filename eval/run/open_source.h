// Frames from a scene file or a sequence on disk, whichever the path names.
#pragma once

#include <filesystem>
#include <memory>

#include "core/frame_source.h"
#include "sequence/sequence_options.h"

namespace tsdfpp {

// A .toml file is a scene and is rendered; anything else is a sequence, opened with `options`.
// `notes`, where given, gets what its reader assumed or left out. Errors: kUsage where there is
// neither or where options for sequences meet a scene, else those of OpenScene and OpenSequence.
Expected<std::unique_ptr<FrameSource>> OpenSource(const std::filesystem::path& scene_or_sequence,
                                                  const SequenceOptions& options = {},
                                                  SequenceNotes* notes = nullptr);

// The ids that a list of ids or names stands for. Errors: kUsage, naming the objects there
// are, or the two that one word may mean.
Expected<std::vector<InstanceId>> FindObjects(const SequenceInfo& info,
                                              const std::vector<std::string>& names_or_ids);

// "truck-1", as files are named after objects.
std::string FileStem(const ObjectInfo& object);

}  // namespace tsdfpp
