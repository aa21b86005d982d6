#include "sim/sensor/colour_noise.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "sim/render/linear_light.h"
#include "sim/render/parallel_rows.h"
#include "sim/sensor/sensor_streams.h"

namespace tsdfpp {

double VignettingGain(const Intrinsics& intrinsics, double u, double v, double strength) {
  const double x = (u - intrinsics.cx) / intrinsics.fx;
  const double y = (v - intrinsics.cy) / intrinsics.fy;
  const double cosine_squared = 1 / (1 + x * x + y * y);
  return 1 - strength * (1 - cosine_squared * cosine_squared);
}

double FrameExposure_ev(const ColourSensorConfig& config, std::uint64_t seed, int frame) {
  if (config.exposure_jitter_ev == 0) return config.exposure_ev;
  return config.exposure_ev +
         config.exposure_jitter_ev *
             GaussianDraw(seed, kStreamExposure, static_cast<std::uint64_t>(frame))[0];
}

cv::Mat SenseColour(const ColourSensorConfig& config, std::uint64_t seed, const Frame& frame) {
  if (config == ColourSensorConfig{} || frame.colour.empty()) return frame.colour;
  CV_Assert(frame.colour.type() == CV_8UC3);
  const double exposure = std::exp2(FrameExposure_ev(config, seed, frame.index));
  const bool changes_light =
      exposure != 1 || config.vignetting > 0 || config.full_well_electrons > 0;
  const double shot_variance =
      config.full_well_electrons > 0 ? 1 / config.full_well_electrons : 0.0;
  const auto& light_of = LevelToLight();
  const auto frame_key = static_cast<std::uint64_t>(frame.index);
  cv::Mat result(frame.colour.size(), CV_8UC3);
  ParallelRows(result.rows, [&](int v) {
    const auto* in = frame.colour.ptr<cv::Vec3b>(v);
    auto* out = result.ptr<cv::Vec3b>(v);
    for (int u = 0; u < result.cols; ++u) {
      const auto pixel = static_cast<std::uint32_t>(v * result.cols + u);
      std::array<double, 4> shot{};
      std::array<double, 4> level_noise{};
      if (shot_variance > 0) shot = GaussianDraw(seed, kStreamShotNoise, frame_key, pixel);
      if (config.noise_levels > 0) {
        level_noise = GaussianDraw(seed, kStreamLevelNoise, frame_key, pixel);
      }
      const double gain = exposure * VignettingGain(frame.intrinsics, u, v, config.vignetting);
      for (int c = 0; c < 3; ++c) {
        const auto channel = static_cast<std::size_t>(c);
        double level = in[u][c];
        if (changes_light) {
          const double light = gain * light_of[in[u][c]];
          level = LightToLevel(light + std::sqrt(light * shot_variance) * shot[channel]);
        }
        level += config.noise_levels * level_noise[channel];
        out[u][c] = static_cast<std::uint8_t>(std::clamp(std::floor(level + 0.5), 0.0, 255.0));
      }
    }
  });
  return result;
}

}  // namespace tsdfpp
