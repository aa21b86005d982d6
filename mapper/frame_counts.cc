#include "mapper/frame_counts.h"

#include <fmt/format.h>

#include <cmath>

namespace tsdfpp {

void FrameCounts::Add(const Frame& frame, const cv::Mat& labels) {
  ++frames;
  pixels += static_cast<std::int64_t>(frame.depth.total());
  for (int v = 0; v < frame.depth.rows; ++v) {
    const auto* depth = frame.depth.ptr<float>(v);
    const auto* label = labels.ptr<InstanceId>(v);
    for (int u = 0; u < frame.depth.cols; ++u) {
      if (!(depth[u] > 0) || !std::isfinite(depth[u])) continue;
      ++with_depth;
      if (!IsValidDepth(depth[u])) continue;
      ++in_range;
      if (label[u] != kNoInstance) ++labelled;
    }
  }
}

std::string FrameCounts::Text() const {
  if (frames == 0) return "no frame was mapped";
  return fmt::format(
      "of {} pixels in {} frame{} {} have a depth, {} of them within {:g} m and {} of those a "
      "label",
      pixels, frames, frames == 1 ? "" : "s", with_depth, in_range, kMaxValidDepth_m, labelled);
}

}  // namespace tsdfpp
