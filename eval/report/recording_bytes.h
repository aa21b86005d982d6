// What record/record.bin of a comparison holds, as far as a page could fail at it.
#pragma once

#include <string>

#include "core/error.h"
#include "eval/report/recording.h"

namespace tsdfpp {

// Whether the recording's meshes can be unpacked and its images begin as WebP images do; `file`
// begins the sentence. Errors: kData.
Expected<void> CheckRecordedBytes(const Recording& recording, const std::string& file);

}  // namespace tsdfpp
