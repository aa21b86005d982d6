// What the measurements behind docs/scaling.md share.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

inline constexpr const char* kMovingScene = "scenes/toycar3.toml";
inline constexpr const char* kStaticScene = "scenes/static.toml";

// The maps whose growth is measured.
inline constexpr std::array<Method, 4> kScalingMethods{Method::kTsdf, Method::kTsdfpp,
                                                       Method::kTsdfppAnchored, Method::kVolumes};

// The default settings with the paper's truncation.
Expected<MapConfig> ScalingConfig();

// With given poses.
Pipeline ScalingPipeline(Method method, const MapConfig& config,
                         const std::vector<ObjectInfo>& objects);

// Times of many frames, in ms.
struct Times {
  std::vector<double> ms;

  double Median() const;
  // The value that a share `q` of the times does not exceed (nearest rank).
  double Quantile(double q) const;
  double Worst() const;
};

// By frame the least of several runs: what else a machine does only adds. As many times in each.
Times LeastOf(const std::vector<Times>& runs);

}  // namespace tsdfpp
