#include "cli/metric.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {

Run AddMetricList(CLI::App&) {
  return []() -> Expected<CommandResult> {
    return CommandResult{MetricsJson(), MetricsMarkdown()};
  };
}

}  // namespace tsdfpp
