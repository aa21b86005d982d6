#include "mapper/segment/joined_segments.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numeric>

namespace tsdfpp {
namespace {

// A segment's pixels on each instance (by place in the list and 1; 0: on none), where there are
// any.
using Overlaps = std::map<std::size_t, std::int64_t>;

// By segment of depth.
std::vector<Overlaps> CountOverlaps(const cv::Mat& depth, const cv::Mat& painted) {
  std::vector<Overlaps> overlaps;
  for (int v = 0; v < depth.rows; ++v) {
    const auto* segment = depth.ptr<InstanceId>(v);
    const auto* instance = painted.ptr<std::uint16_t>(v);
    for (int u = 0; u < depth.cols; ++u) {
      if (segment[u] == kNoInstance) continue;
      if (segment[u] >= overlaps.size()) overlaps.resize(segment[u] + std::size_t{1});
      ++overlaps[segment[u]][instance[u]];
    }
  }
  return overlaps;
}

// The instance that has more than join_overlap of a segment, or that with it has more than join_iou
// in common; 0 where there is none. `areas` are the instances' pixels by place and 1.
std::size_t InstanceOf(const Overlaps& overlaps, std::span<const std::int64_t> areas,
                       const NetworkConfig& config) {
  std::int64_t all = 0;
  for (const auto& [instance, count] : overlaps) all += count;
  for (const auto& [instance, count] : overlaps) {
    if (instance == 0) continue;
    const auto both = static_cast<double>(count);
    if (both > config.join_overlap * static_cast<double>(all) ||
        both > config.join_iou * static_cast<double>(all + areas[instance] - count)) {
      return instance;
    }
  }
  return 0;
}

}  // namespace

cv::Mat PaintInstances(std::span<const Instance> instances, cv::Size size) {
  std::vector<std::size_t> order(instances.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  // The best is painted last.
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return instances[a].score != instances[b].score ? instances[a].score < instances[b].score
                                                    : a > b;
  });
  cv::Mat painted(size, CV_16UC1, cv::Scalar(0));
  for (const std::size_t i : order) {
    const auto& [box, mask, semantic_class, score] = instances[i];
    painted(box).setTo(static_cast<double>(i + 1), mask);
  }
  return painted;
}

Segments JoinSegments(const cv::Mat& depth, const cv::Mat& painted,
                      std::span<const Instance> instances, const NetworkConfig& config) {
  const auto overlaps = CountOverlaps(depth, painted);
  // By place and 1: pixels of an instance, of them those on segments that are its, and those that
  // no instance's segment has.
  std::vector<std::int64_t> areas(instances.size() + 1, 0);
  std::vector<std::int64_t> held(instances.size() + 1, 0);
  std::vector<std::int64_t> free(instances.size() + 1, 0);
  for (const Overlaps& on : overlaps) {
    for (const auto& [instance, count] : on) areas[instance] += count;
  }
  std::vector<std::size_t> instance_of(overlaps.size(), 0);
  std::vector<bool> is_found(instances.size() + 1, false);
  for (std::size_t segment = kBackground; segment < overlaps.size(); ++segment) {
    const Overlaps& on = overlaps[segment];
    const std::size_t instance = segment == kBackground ? 0 : InstanceOf(on, areas, config);
    instance_of[segment] = instance;
    if (instance == 0) {
      for (const auto& [other, count] : on) free[other] += count;
    } else {
      is_found[instance] = true;
      held[instance] += on.at(instance);
    }
  }
  std::vector<bool> keeps_mask(instances.size() + 1, false);
  for (std::size_t i = 1; i <= instances.size(); ++i) {
    keeps_mask[i] =
        instances[i - 1].score >= config.mask_score && 2 * held[i] < areas[i] && free[i] > 0;
  }

  Segments joined;
  InstanceId next = kBackground + 1;
  std::vector<InstanceId> id_of_instance(instances.size() + 1, kNoInstance);
  for (std::size_t i = 1; i <= instances.size(); ++i) {
    if (!is_found[i] && !keeps_mask[i]) continue;
    joined.classes[next] = instances[i - 1].semantic_class;
    id_of_instance[i] = next++;
  }
  std::vector<InstanceId> id_of(overlaps.size(), kBackground);
  for (std::size_t segment = kBackground + 1; segment < overlaps.size(); ++segment) {
    if (overlaps[segment].empty()) continue;
    if (instance_of[segment] != 0) {
      id_of[segment] = id_of_instance[instance_of[segment]];
    } else {
      if (!config.unknown_objects) joined.unknown.push_back(next);
      id_of[segment] = next++;
    }
  }
  joined.ids = depth.clone();
  for (int v = 0; v < joined.ids.rows; ++v) {
    auto* id = joined.ids.ptr<InstanceId>(v);
    const auto* instance = painted.ptr<std::uint16_t>(v);
    for (int u = 0; u < joined.ids.cols; ++u) {
      if (id[u] == kNoInstance) {
        // No segment's: an instance that is there has it.
        id[u] = id_of_instance[instance[u]];
      } else if (keeps_mask[instance[u]] && instance_of[id[u]] == 0) {
        id[u] = id_of_instance[instance[u]];
      } else {
        id[u] = id_of[id[u]];
      }
    }
  }
  return joined;
}

Expected<Segments> InstanceSegments::Segment(const Frame& frame) {
  Segments segments;
  if (frames_++ % config_.every != 0) {
    segments.ids = cv::Mat(frame.depth.size(), CV_16UC1, cv::Scalar(kNoInstance));
    return segments;
  }
  TSDFPP_ASSIGN(const std::vector<Instance> instances, finder_->Find(frame));
  segments.ids = PaintInstances(instances, frame.depth.size());
  for (std::size_t i = 0; i < instances.size(); ++i) {
    segments.classes[static_cast<InstanceId>(i + 1)] = instances[i].semantic_class;
  }
  return segments;
}

Expected<Segments> JoinedSegments::Segment(const Frame& frame) {
  TSDFPP_ASSIGN(const Segments segments, depth_.Segment(frame));
  if (frames_++ % config_.every != 0) {
    return JoinSegments(segments.ids, PaintInstances({}, frame.depth.size()), {}, config_);
  }
  TSDFPP_ASSIGN(const std::vector<Instance> instances, finder_->Find(frame));
  const cv::Mat painted = PaintInstances(instances, frame.depth.size());
  return JoinSegments(segments.ids, painted, instances, config_);
}

}  // namespace tsdfpp
