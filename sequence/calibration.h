// calibration.txt: "fx fy cx cy [w h]", as Co-Fusion and ElasticFusion write their camera.
#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// Width and height are 0 where they are not given. Errors: kData, naming the file: another count,
// words that are no numbers, focal lengths or sizes that are not over 0.
Expected<Intrinsics> ReadCalibration(const std::filesystem::path& path);

// The same with `fy` negative where the image's y axis points up (SequenceOptions::intrinsics).
Expected<Intrinsics> ReadSignedCalibration(const std::filesystem::path& path);

// The six numbers with all their bits, and a line end.
std::string CalibrationToText(const Intrinsics& camera);

}  // namespace tsdfpp
