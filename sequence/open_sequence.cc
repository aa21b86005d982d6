#include "sequence/open_sequence.h"

#include "sequence/cofusion_layout.h"
#include "sequence/cofusion_reader.h"

namespace tsdfpp {
namespace fs = std::filesystem;

Expected<std::unique_ptr<FrameSource>> OpenSequence(const fs::path& folder) {
  std::error_code code;
  if (!fs::exists(folder, code)) return UsageError("{}: no such folder", folder.string());
  if (!fs::is_directory(folder, code)) {
    return UsageError("{}: is a file, expected the folder of a sequence", folder.string());
  }
  if (cofusion::IsCofusion(folder)) return OpenCofusion(folder);
  const bool calibrated = fs::exists(folder / cofusion::kCalibration, code);
  return DataError(
      "{}: not a sequence, there is no {}; expected a Co-Fusion set ({}, {}/, {}/, {})",
      folder.string(), calibrated ? std::string(cofusion::kColour) + "/" : cofusion::kCalibration,
      cofusion::kCalibration, cofusion::kColour, cofusion::kDepth, cofusion::kCameraTrajectory);
}

}  // namespace tsdfpp
