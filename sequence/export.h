// Writes any stream of frames in another dataset's format.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"
#include "sequence/sequence_options.h"

namespace tsdfpp {

// Units of depth of what is written, per metre; a depth that is kept is off by half a unit at most.
inline constexpr double kTumExportUnits = 5000;   // 0.1 mm
inline constexpr double kBopExportUnits = 10000;  // 0.05 mm: depth_scale 0.1
inline constexpr double kMillimetreUnits = 1000;  // 0.5 mm: klg, 7scenes

// Times: TUM keeps them to 0.5 us, klg to 0.5 us; BOP and 7-Scenes know none (30 Hz).
// Poses: TUM and klg keep them as text (core/pose_text.h), exactly if they went through it; BOP and
// 7-Scenes to this, as matrices with all bits that are made orthonormal and inverted again.
inline constexpr double kMatrixPoseBound_m = 1e-9;

struct ExportReport {
  int frames = 0;
  double depth_bound_m = 0;           // greatest error of a depth that is kept
  std::vector<std::string> left_out;  // what the format cannot hold
};

// Formats: kTum, kBop, kKlg, kSevenScenes. Writes into `out`, which must be new or empty and
// appears whole or not at all. `stop`, set by a signal handler, ends it between two frames.
// docs/datasets.md lists the files. Errors: those of the source; kUsage for another format or an
// `out` that may not be written; kData where a frame does not fit the source's own description or
// the format; kEnvironment where the disk refuses or it was stopped.
Expected<ExportReport> ExportSequence(FrameSource& source, DatasetFormat format,
                                      const std::filesystem::path& out,
                                      const std::function<void(int done, int total)>& progress = {},
                                      const std::atomic<bool>* stop = nullptr);

}  // namespace tsdfpp
