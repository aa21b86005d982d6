// What the subcommands of `tsdfpp metric` share.
#pragma once

#include <string>
#include <vector>

#include "cli/command.h"
#include "metrics/measured.h"

namespace tsdfpp {

// Prints SweepMetrics() as a table in Markdown, or as JSON.
Run AddMetricList(CLI::App& app);
Run AddMetricTrajectory(CLI::App& app);
Run AddMetricSurface(CLI::App& app);
Run AddMetricPanoptic(CLI::App& app);
Run AddMetricPose(CLI::App& app);

// "12.3400 mm": a length in metres, or "undefined: " and the reason.
std::string LengthText(const Measured& metres);
// "0.8123", or "undefined: " and the reason.
std::string ShareText(const Measured& share);

// The numbers between commas, each above 0. Errors: kUsage, naming the option.
Expected<std::vector<double>> PositiveNumbers(const std::string& text, const std::string& option);

}  // namespace tsdfpp
