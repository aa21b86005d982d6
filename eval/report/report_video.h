// `tsdfpp report --video`: a recorded comparison as a film (docs/report.md).
#pragma once

#include <filesystem>

#include "core/error.h"

namespace tsdfpp {

struct ReportVideo {
  int frames = 0;
  int width = 0;
  int height = 0;
  double seconds = 0;
};

// Writes an MP4 (H.264): colour and masks, each map as it grows, and at the end the removal. Its
// stills are the comparison's evaluated frames. Errors: kData where `run` has no recording, its
// stills are no growing frame numbers, or a still cannot be read, or is of an interrupted run;
// kEnvironment where OpenCV has no H.264 encoder or the disk refuses: then no file is there.
Expected<ReportVideo> WriteReportVideo(const std::filesystem::path& run,
                                       const std::filesystem::path& file);

}  // namespace tsdfpp
