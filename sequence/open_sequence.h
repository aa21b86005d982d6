// Opens a dataset on disk, whatever its format.
#pragma once

#include <filesystem>
#include <memory>

#include "core/error.h"
#include "core/frame_source.h"

namespace tsdfpp {

// Detects the format of the sequence in `folder` and opens it. Co-Fusion sets are known (by
// calibration.txt beside colour/). Errors: kUsage where there is no such folder, kData where its
// format is not known, else those of the format's reader.
Expected<std::unique_ptr<FrameSource>> OpenSequence(const std::filesystem::path& folder);

}  // namespace tsdfpp
