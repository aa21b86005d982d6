#include "mapper/segment/depth_noise.h"

#include <cstdlib>

namespace tsdfpp {

std::string_view DepthNoiseName(DepthNoise noise) {
  switch (noise) {
    case DepthNoise::kExact:
      return "exact";
    case DepthNoise::kNguyen2012:
      return "nguyen2012";
  }
  std::abort();
}

Expected<DepthNoise> DepthNoiseFromName(std::string_view name) {
  for (const DepthNoise noise : {DepthNoise::kExact, DepthNoise::kNguyen2012}) {
    if (name == DepthNoiseName(noise)) return noise;
  }
  return UsageError("depth noise '{}' is unknown, expected exact or nguyen2012", name);
}

}  // namespace tsdfpp
