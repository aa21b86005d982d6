// Toys as a finer camera sees them, with noise.
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"

namespace tsdfpp {

inline Intrinsics FineCamera() { return {384, 288, 320.0, 320.0, 191.5, 143.5}; }

// The depth with Gaussian noise, which the frame's number draws.
inline Frame WithNoise(Frame frame, double noise_m) {
  cv::RNG random(static_cast<std::uint64_t>(frame.index) + 1);
  cv::Mat noise(frame.depth.size(), CV_32FC1);
  random.fill(noise, cv::RNG::NORMAL, 0, noise_m);
  noise.setTo(0, frame.depth == 0);
  frame.depth += noise;
  return frame;
}

}  // namespace tsdfpp
