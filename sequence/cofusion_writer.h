// Writes any stream of frames as a Co-Fusion set with our extra files (sequence.json, models/).
#pragma once

#include <filesystem>
#include <functional>

#include "core/error.h"
#include "core/frame_source.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {

// Called after each frame with the number of frames done and of all frames.
using ProgressCallback = std::function<void(int done, int total)>;

// Writes all frames and the true models of `source` into the folder `out`. The frames that
// OpenCofusion reads back have the same bytes, poses included if they went through text
// (core/pose_text.h), and the time (index - first_index) / rate.
// The folder appears whole or not at all: files are made in a hidden folder beside it, renamed at
// the end. An existing folder must be empty or, with `overwrite`, an earlier sequence of ours.
// Errors: those of the source; kUsage where the folder may not be replaced or an object's name or
// id does not fit into a file name or an 8-bit mask; kData where a frame does not fit the source's
// own description; kEnvironment where the disk refuses.
Expected<void> WriteCofusion(FrameSource& source, const GeneratorInfo& generator,
                             const std::filesystem::path& out, bool overwrite = false,
                             const ProgressCallback& progress = {});

}  // namespace tsdfpp
