#include "sim/render/linear_light.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp {

const std::array<float, 256>& LevelToLight() {
  static const std::array<float, 256> kLight = [] {
    std::array<float, 256> light{};
    for (std::size_t level = 0; level < light.size(); ++level) {
      const double value = static_cast<double>(level) / 255;
      light[level] = static_cast<float>(value <= 0.04045 ? value / 12.92
                                                         : std::pow((value + 0.055) / 1.055, 2.4));
    }
    return light;
  }();
  return kLight;
}

double LightToLevel(double light) {
  light = std::clamp(light, 0.0, 1.0);
  const double value =
      light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
  return 255 * value;
}

}  // namespace tsdfpp
