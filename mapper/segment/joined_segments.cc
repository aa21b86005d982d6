#include "mapper/segment/joined_segments.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numeric>
#include <opencv2/core/utility.hpp>

#include "mapper/segment/give_way.h"
#include "mapper/segment/pixel_rays.h"

namespace tsdfpp {
namespace {

constexpr double kCarriedOverlap = 0.5;

// A segment's pixels on each instance (by place in the list and 1; 0: on none), where there are
// any.
using Overlaps = std::map<std::size_t, std::int64_t>;

// By segment of depth.
std::vector<Overlaps> CountOverlaps(const cv::Mat& depth, const cv::Mat& painted) {
  struct Run {
    InstanceId segment = 0;
    std::uint16_t instance = 0;
    int pixels = 0;
  };
  std::array<std::vector<Run>, kRowStrips> runs;
  ForEachStrip(depth.rows, [&](std::size_t strip, int first, int last) {
    for (int v = first; v < last; ++v) {
      const auto* segment = depth.ptr<InstanceId>(v);
      const auto* instance = painted.ptr<std::uint16_t>(v);
      for (int u = 0; u < depth.cols;) {
        const Run run{segment[u], instance[u]};
        const int begin = u;
        while (u < depth.cols && segment[u] == run.segment && instance[u] == run.instance) ++u;
        if (run.segment == kNoInstance) continue;
        runs[strip].push_back({run.segment, run.instance, u - begin});
      }
    }
  });
  std::vector<Overlaps> overlaps;
  for (const auto& of_strip : runs) {
    for (const Run& run : of_strip) {
      if (run.segment >= overlaps.size()) overlaps.resize(std::size_t{run.segment} + 1);
      overlaps[run.segment][run.instance] += run.pixels;
    }
  }
  return overlaps;
}

// By place and 1: painted instances of which `areas` knows no pixel, as all are of parts too small
// to be segments.
std::vector<bool> FindLone(const cv::Mat& painted, std::span<const std::int64_t> areas) {
  std::vector<bool> is_lone(areas.size(), false);
  if (std::find(areas.begin() + 1, areas.end(), 0) == areas.end()) return is_lone;
  for (int v = 0; v < painted.rows; ++v) {
    const auto* row = painted.ptr<std::uint16_t>(v);
    for (int u = 0; u < painted.cols; ++u) {
      if (row[u] != 0 && areas[row[u]] == 0) is_lone[row[u]] = true;
    }
  }
  return is_lone;
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

// On one thread, this one, which is not needed again.
Expected<std::vector<Instance>> FindGivingWay(InstanceFinder& finder, const Frame& frame) {
  GiveWay();
  // A loop of OpenCV's within another is run by the thread that is in it.
  std::optional<Expected<std::vector<Instance>>> found;
  cv::parallel_for_(cv::Range(0, 1),
                    [&](const cv::Range&) { found = FindInstances(finder, frame); });
  return *std::move(found);
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
                      std::span<const Instance> instances, const NetworkConfig& config,
                      std::vector<InstanceId>* of_masks) {
  const auto overlaps = CountOverlaps(depth, painted);
  // By place and 1: pixels of an instance, of them those on segments that are its, and those that
  // no instance's segment has.
  std::vector<std::int64_t> areas(instances.size() + 1, 0);
  std::vector<std::int64_t> held(instances.size() + 1, 0);
  std::vector<std::int64_t> free(instances.size() + 1, 0);
  for (const Overlaps& on : overlaps) {
    for (const auto& [instance, count] : on) areas[instance] += count;
  }
  const std::vector<bool> is_lone = FindLone(painted, areas);
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
  // Ids are as many as segments at most, and masks get what is left of them.
  std::size_t ids = overlaps.size();
  std::vector<std::uint8_t> keeps_mask(instances.size() + 1, 0);
  for (std::size_t i = 1; i <= instances.size(); ++i) {
    const bool is_bare = is_lone[i] || (2 * held[i] < areas[i] && free[i] > 0);
    if (instances[i - 1].score < config.mask_score || !is_bare) continue;
    if (!is_found[i] && ids + 1 > kNoInstance) continue;
    keeps_mask[i] = 1;
    ids += is_found[i] ? 0 : 1;
  }

  Segments joined;
  InstanceId next = kBackground + 1;
  std::vector<InstanceId> id_of_instance(instances.size() + 1, kNoInstance);
  for (std::size_t i = 1; i <= instances.size(); ++i) {
    if (!is_found[i] && keeps_mask[i] == 0) continue;
    joined.classes[next] = instances[i - 1].semantic_class;
    if (keeps_mask[i] != 0 && of_masks != nullptr) of_masks->push_back(next);
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
  joined.ids.create(depth.size(), CV_16UC1);
  ForEachRow(depth.rows, [&](int v) {
    const auto* segment = depth.ptr<InstanceId>(v);
    const auto* instance = painted.ptr<std::uint16_t>(v);
    auto* id = joined.ids.ptr<InstanceId>(v);
    for (int u = 0; u < depth.cols; ++u) {
      // An instance that is there has what is no segment's, and what its mask keeps of others.
      const bool is_mask = segment[u] == kNoInstance ||
                           (keeps_mask[instance[u]] != 0 && instance_of[segment[u]] == 0);
      id[u] = is_mask ? id_of_instance[instance[u]] : id_of[segment[u]];
    }
  });
  return joined;
}

Expected<Segments> InstanceSegments::Segment(const Frame& frame) {
  Segments segments;
  if (frames_ % config_.every != 0) {
    ++frames_;
    segments.ids = cv::Mat(frame.depth.size(), CV_16UC1, cv::Scalar(kNoInstance));
    return segments;
  }
  TSDFPP_ASSIGN(const std::vector<Instance> instances, FindInstances(*finder_, frame));
  ++frames_;
  segments.ids = PaintInstances(instances, frame.depth.size());
  for (std::size_t i = 0; i < instances.size(); ++i) {
    segments.classes[static_cast<InstanceId>(i + 1)] = instances[i].semantic_class;
  }
  return segments;
}

const Segments& KnownSegments::Set(const cv::Mat& depth, std::span<const Instance> instances) {
  return Join(depth, PaintInstances(instances, depth.size()), instances, config_);
}

const Segments& KnownSegments::Carry(const cv::Mat& depth) {
  if (depth.size() != last_depth_.size()) return Set(depth, {});
  // Those of instances have the first ids, so that an id is an instance's place and 1.
  std::vector<Instance> instances;
  std::vector<std::uint8_t> is_mask{0};
  for (const auto& [id, name] : last_.classes) {
    const bool is_of_mask = std::binary_search(of_masks_.begin(), of_masks_.end(), id);
    is_mask.push_back(is_of_mask ? 1 : 0);
    instances.push_back({{}, {}, name, is_of_mask ? 1.F : -1.F});
  }
  // What is no instance's is left out, and what was filled up, as it moves with nothing.
  cv::Mat painted(depth.size(), CV_16UC1);
  ForEachRow(painted.rows, [&](int v) {
    const auto* id = last_.ids.ptr<InstanceId>(v);
    const auto* before = last_depth_.ptr<InstanceId>(v);
    auto* to = painted.ptr<std::uint16_t>(v);
    for (int u = 0; u < painted.cols; ++u) {
      const bool is_left_out =
          id[u] > instances.size() || (before[u] == kNoInstance && is_mask[id[u]] == 0);
      to[u] = is_left_out ? std::uint16_t{0} : id[u];
    }
  });
  // What moved on lies half beside itself at worst.
  NetworkConfig config = config_;
  config.join_overlap = kCarriedOverlap;
  return Join(depth, painted, instances, config);
}

const Segments& KnownSegments::Join(const cv::Mat& depth, const cv::Mat& painted,
                                    std::span<const Instance> instances,
                                    const NetworkConfig& config) {
  of_masks_.clear();
  last_ = JoinSegments(depth, painted, instances, config, &of_masks_);
  last_depth_ = depth;
  return last_;
}

JoinedSegments::Search JoinedSegments::Begin(const Frame& frame) const {
  // What a network sees, in images of its own: who gave the frame may write into them.
  Frame copy;
  copy.index = frame.index;
  copy.time_s = frame.time_s;
  copy.intrinsics = frame.intrinsics;
  copy.T_WC = frame.T_WC;
  copy.depth = frame.depth.clone();
  copy.colour = frame.colour.clone();
  Search search;
  search.frame = frames_;
  search.found = std::async(std::launch::async, [finder = finder_, copy = std::move(copy),
                                                 gives_way = config_.gives_way] {
    return gives_way ? FindGivingWay(*finder, copy) : FindInstances(*finder, copy);
  });
  return search;
}

Expected<void> JoinedSegments::Take(Search search) {
  TSDFPP_ASSIGN(const std::vector<Instance> instances, search.found.get());
  known_.Set(search.depth.front(), instances);
  for (std::size_t i = 1; i < search.depth.size(); ++i) known_.Carry(search.depth[i]);
  return {};
}

Expected<Segments> JoinedSegments::Segment(const Frame& frame) {
  TSDFPP_ASSIGN(const Segments depth, depth_.Segment(frame));
  // Nothing is known of the first image, nor is it carried to one of another size.
  const bool is_first = depth.ids.size() != known_.last().ids.size();
  const bool is_asked = is_first || frames_ % config_.every == 0;
  if (is_first) search_.reset();
  if (is_first || (is_asked && config_.latency == 0)) {
    TSDFPP_ASSIGN(const std::vector<Instance> instances, FindInstances(*finder_, frame));
    ++frames_;
    return known_.Set(depth.ids, instances);
  }
  if (search_ && frames_ == search_->frame + config_.latency) {
    Search search = std::move(*search_);
    search_.reset();
    TSDFPP_RETURN_IF_ERROR(Take(std::move(search)));
  }
  known_.Carry(depth.ids);
  if (is_asked) search_ = Begin(frame);
  if (search_) search_->depth.push_back(depth.ids);
  ++frames_;
  return known_.last();
}

}  // namespace tsdfpp
