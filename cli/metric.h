// What the subcommands of `tsdfpp metric` share.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/types.h"
#include "metrics/measured.h"

namespace tsdfpp {

Run AddMetricTrajectory(CLI::App& app);
Run AddMetricSurface(CLI::App& app);
Run AddMetricPanoptic(CLI::App& app);
Run AddMetricPose(CLI::App& app);

// A PLY, OBJ or STL file as it is, its positions times `scale`; without faces it is a set of points
// (PLY only). Errors: kUsage where the name ends in none of these, kData where it cannot be read.
Expected<TriangleMesh> ReadSurfaceFile(const std::filesystem::path& path, double scale);

// "12.3400 mm": a length in metres, or "undefined: " and the reason.
std::string LengthText(const Measured& metres);
// "0.8123", or "undefined: " and the reason.
std::string ShareText(const Measured& share);

// The numbers between commas, each above 0. Errors: kUsage, naming the option.
Expected<std::vector<double>> PositiveNumbers(const std::string& text, const std::string& option);

}  // namespace tsdfpp
