#include "mapper/segment/depth_segments.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "mapper/segment/background.h"
#include "mapper/segment/components.h"

namespace tsdfpp {

Expected<Segments> DepthSegments::Segment(const Frame& frame) {
  const cv::Mat& depth = frame.depth;
  if (depth.type() != CV_32FC1 || depth.cols != frame.intrinsics.width ||
      depth.rows != frame.intrinsics.height) {
    return DataError("frame {}: depth is {} x {} of OpenCV type {}, expected {} x {} floats",
                     frame.index, depth.cols, depth.rows, depth.type(), frame.intrinsics.width,
                     frame.intrinsics.height);
  }
  maps_ = &mapper_.Compute(depth, frame.intrinsics, config_);
  FindInner();
  const PixelLinks links{maps_->reach_right, maps_->reach_down};
  labels_.create(depth.size(), CV_32SC1);
  labels_.setTo(0);
  std::int32_t end = LabelComponents(inner_, links, kBackgroundLabel + 1, labels_);
  GrowLabels(maps_->inverse_depth, links, inner_, labels_);
  // What is too thin to have an inside.
  ForEachRow(depth.rows, [&](int v) {
    const auto* q = maps_->inverse_depth.ptr<float>(v);
    const auto* label = labels_.ptr<std::int32_t>(v);
    auto* to = inner_.ptr<std::uint8_t>(v);
    for (int u = 0; u < depth.cols; ++u) to[u] = q[u] != 0 && label[u] == 0 ? 255 : 0;
  });
  end = LabelComponents(inner_, links, end, labels_);
  const double pixels = static_cast<double>(depth.rows) * depth.cols;
  const PartSize least{static_cast<std::int64_t>(std::ceil(config_.min_share * pixels)),
                       config_.min_m2};
  end = JoinSmall(links, least, kBackgroundLabel + 1,
                  MeasureParts(labels_, maps_->depth, maps_->rays.pixel_width, end), labels_);
  end = background_.Part(*maps_, links, least, end, config_, labels_);
  TSDFPP_ASSIGN(cv::Mat ids, IdsOf(frame, end));
  return Segments{std::move(ids)};
}

namespace {

// Marks where there is no link.
void AddCuts(const std::uint8_t* links, int count, std::uint8_t* edges) {
  for (int i = 0; i < count; ++i) {
    edges[i] = static_cast<std::uint8_t>(edges[i] | (links[i] == 0 ? 255 : 0));
  }
}

}  // namespace

void DepthSegments::FindInner() {
  const SurfaceMaps& maps = *maps_;
  const int rows = maps.concave.rows;
  const int cols = maps.concave.cols;
  edge_.create(maps.concave.size(), CV_8UC1);
  inner_.create(maps.concave.size(), CV_8UC1);
  ForEachRow(rows, [&](int v) {
    const auto* concave = maps.concave.ptr<std::uint8_t>(v);
    const auto* right = maps.reach_right.ptr<std::uint8_t>(v);
    const auto* down = maps.reach_down.ptr<std::uint8_t>(v);
    const auto* above = maps.reach_down.ptr<std::uint8_t>(std::max(v - 1, 0));
    auto* to = edge_.ptr<std::uint8_t>(v);
    std::copy(concave, concave + cols, to);
    if (v + 1 < rows) AddCuts(down, cols, to);
    if (v > 0) AddCuts(above, cols, to);
    AddCuts(right, cols - 1, to);
    AddCuts(right, cols - 1, to + 1);
  });
  ForEachRow(rows, [&](int v) {
    const auto* q = maps.inverse_depth.ptr<float>(v);
    const auto* row = edge_.ptr<std::uint8_t>(v);
    const auto* above = edge_.ptr<std::uint8_t>(std::max(v - 1, 0));
    const auto* below = edge_.ptr<std::uint8_t>(std::min(v + 1, rows - 1));
    // With a column without edges on either side.
    std::vector<std::uint8_t> columns(static_cast<std::size_t>(cols) + 2);
    auto* column = columns.data() + 1;
    for (int u = 0; u < cols; ++u) {
      column[u] = static_cast<std::uint8_t>(above[u] | row[u] | below[u]);
    }
    auto* to = inner_.ptr<std::uint8_t>(v);
    for (int u = 0; u < cols; ++u) {
      const int around = column[u - 1] | column[u] | column[u + 1];
      to[u] = static_cast<int>(around == 0) & static_cast<int>(q[u] != 0) ? 255 : 0;
    }
  });
}

Expected<cv::Mat> DepthSegments::IdsOf(const Frame& frame, std::int32_t end) const {
  const cv::Mat& depth = frame.depth;
  const std::vector<std::int32_t> pixels = CountLabels(labels_, end);
  std::vector<std::size_t> order;
  for (std::size_t label = kBackgroundLabel + 1; label < pixels.size(); ++label) {
    if (pixels[label] > 0) order.push_back(label);
  }
  constexpr std::size_t kMostSegments = kNoInstance - 1;
  if (order.size() > kMostSegments) {
    return DataError(
        "frame {}: its depth falls into {} segments, expected at most {}: min_share or min_m2 is "
        "too "
        "low",
        frame.index, order.size(), kMostSegments);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return pixels[a] > pixels[b]; });
  std::vector<InstanceId> id_of(pixels.size(), kNoInstance);
  id_of[kBackgroundLabel] = kBackground;
  for (std::size_t i = 0; i < order.size(); ++i) {
    id_of[order[i]] = static_cast<InstanceId>(i + 1);
  }
  cv::Mat ids(depth.size(), CV_16UC1);
  ForEachRow(depth.rows, [&](int v) {
    const auto* z = depth.ptr<float>(v);
    const auto* label = labels_.ptr<std::int32_t>(v);
    auto* to = ids.ptr<InstanceId>(v);
    for (int u = 0; u < depth.cols; ++u) {
      to[u] = IsValidDepth(z[u]) ? id_of[static_cast<std::size_t>(label[u])] : kNoInstance;
    }
  });
  return ids;
}

}  // namespace tsdfpp
