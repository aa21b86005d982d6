#include "bench/scaling_runs.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp {

Expected<MapConfig> ScalingConfig() {
  MapConfig config;
  TSDFPP_RETURN_IF_ERROR(config.SetProfile("paper"));
  return config;
}

Pipeline ScalingPipeline(Method method, const MapConfig& config,
                         const std::vector<ObjectInfo>& objects) {
  return Pipeline(PipelineConfig{.method = method, .map = config}, objects);
}

double Times::Median() const { return Quantile(0.5); }

double Times::Quantile(double q) const {
  std::vector<double> sorted = ms;
  std::sort(sorted.begin(), sorted.end());
  const double rank = std::ceil(q * static_cast<double>(sorted.size()));
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

double Times::Worst() const { return *std::max_element(ms.begin(), ms.end()); }

Times LeastOf(const std::vector<Times>& runs) {
  Times least = runs.front();
  for (const Times& run : runs) {
    for (std::size_t i = 0; i < run.ms.size(); ++i) {
      least.ms[i] = std::min(least.ms[i], run.ms[i]);
    }
  }
  return least;
}

}  // namespace tsdfpp
