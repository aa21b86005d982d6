#include "cli/metric.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <map>
#include <memory>

namespace tsdfpp {

std::string LengthText(const Measured& metres) {
  if (!metres.value) return "undefined: " + metres.why_not;
  return fmt::format("{:.4f} mm", 1e3 * *metres.value);
}

std::string ShareText(const Measured& share) {
  if (!share.value) return "undefined: " + share.why_not;
  return fmt::format("{:.4f}", *share.value);
}

Expected<std::vector<double>> PositiveNumbers(const std::string& text, const std::string& option) {
  std::vector<double> numbers;
  for (const std::string& word : SplitList(text)) {
    double number = 0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (status != std::errc() || end != word.data() + word.size() || !(number > 0) ||
        !std::isfinite(number)) {
      return UsageError("{} '{}': expected numbers above 0 between commas, found '{}'", option,
                        text, word);
    }
    numbers.push_back(number);
  }
  if (numbers.empty()) return UsageError("{} is empty, expected a number at least", option);
  return numbers;
}

Run AddMetric(CLI::App& app, const CommonOptions&) {
  app.require_subcommand(1);
  const auto runs = std::make_shared<std::map<const CLI::App*, Run>>();
  const auto add = [&](const char* name, const char* help, const auto& function) {
    CLI::App* command = app.add_subcommand(name, help);
    // --json and --threads belong to `metric`, and may stand behind its subcommands.
    command->fallthrough();
    command->footer("--json and --threads as for every subcommand.");
    (*runs)[command] = function(*command);
  };
  add("trajectory", "Compare two trajectories (TUM files): APE and RPE", AddMetricTrajectory);
  add("surface", "Compare two surfaces (meshes or points): accuracy, completeness, F-score",
      AddMetricSurface);
  add("panoptic", "Compare two folders of segmented images: PQ, STQ, IoU", AddMetricPanoptic);
  add("pose", "Compare an object's poses at its model's points: ADD, ADD-S, MSSD, MSPD, AUC",
      AddMetricPose);
  add("list", "Print every metric of comparisons and experiments, with its definition",
      AddMetricList);
  return [&app, runs] { return runs->at(app.get_subcommands().front())(); };
}

}  // namespace tsdfpp
