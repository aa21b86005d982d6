// What frames hold that a map can be made of, counted.
#pragma once

#include <cstdint>
#include <string>

#include "core/types.h"

namespace tsdfpp {

struct FrameCounts {
  std::int64_t frames = 0;
  std::int64_t pixels = 0;
  std::int64_t with_depth = 0;  // of these: finite and above 0
  std::int64_t in_range = 0;    // of these: at most kMaxValidDepth_m
  std::int64_t labelled = 0;    // of these: of an object, which may be the background

  // The images must be of one size and of the types that core/types.h states.
  void Add(const Frame& frame, const cv::Mat& labels);
  // "of 6912 pixels in 1 frame 6000 have a depth, 0 of them within 100 m and 0 of those a label",
  // or that no frame was mapped.
  std::string Text() const;
};

}  // namespace tsdfpp
