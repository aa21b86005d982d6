// Segments of a network's instances, alone or joined with those of depth (paper III-B).
#pragma once

#include <future>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mapper/segment/depth_segments.h"
#include "mapper/segment/instance_finder.h"
#include "mapper/segment/network_config.h"
#include "mapper/segment/segmenter.h"

namespace tsdfpp {

// The place in `instances` of each pixel's instance and 1: that of the greatest score whose mask
// has the pixel, of equal ones the first; 0 where there is none. CV_16UC1. At most kNoInstance - 1
// instances, whose boxes lie within `size`.
cv::Mat PaintInstances(std::span<const Instance> instances, cv::Size size);

// A segment of `depth` (as DepthSegments gives them) becomes an instance's, and gets its class:
//  - where more than join_overlap of its pixels lie on the instance (paper III-B, tau_overlap), so
//    that a thing in parts becomes one;
//  - or where the two have more than join_iou in common, pixels of both by pixels of either: then
//    they are the same thing, whatever the mask lacks.
// A segment's pixels that are `painted` (PaintInstances) as an instance's lie on it. Counted are
// pixels that a segment or the background has; the others of such an instance (kNoInstance) become
// its, too. An instance of at least mask_score of which such segments hold less than half, as no
// segment lies on what is flat or thin, or which has no pixel that is counted, has all its pixels
// but those that became another's; where ids run out, the later ones are left out. Segments that
// became no instance's are unknown, or objects of their own with unknown_objects. Ids are numbered
// anew, those of instances first, each in the order that it had. `of_masks`, where given, gets the
// ids of instances that kept their masks.
Segments JoinSegments(const cv::Mat& depth, const cv::Mat& painted,
                      std::span<const Instance> instances, const NetworkConfig& config,
                      std::vector<InstanceId>* of_masks = nullptr);

// The instances as segments with ids from 1 on, in the finder's order; what belongs to none is
// background.
class InstanceSegments : public Segmenter {
 public:
  // The config must be valid.
  InstanceSegments(std::shared_ptr<InstanceFinder> finder, const NetworkConfig& config)
      : finder_(std::move(finder)), config_(config) {}

  // With config.every above 1 the frames between have no segments: all of them is kNoInstance.
  // Errors: the finder's.
  Expected<Segments> Segment(const Frame& frame) override;

 private:
  std::shared_ptr<InstanceFinder> finder_;
  NetworkConfig config_;
  int frames_ = 0;
};

// What is known of a frame's segments, carried from one frame to the next.
class KnownSegments {
 public:
  explicit KnownSegments(const NetworkConfig& config) : config_(config) {}

  // The segments of the frame whose instances these are.
  const Segments& Set(const cv::Mat& depth, std::span<const Instance> instances);
  // Those of the next frame, of which no instances are known: as if the segments that the last one
  // had of instances were instances of this one, which are joined with the segments of this one's
  // depth that lie on them by more than half. A mask stays where it was. Nothing is known where the
  // last one was of another size, or there was none.
  const Segments& Carry(const cv::Mat& depth);

  const Segments& last() const { return last_; }

 private:
  const Segments& Join(const cv::Mat& depth, const cv::Mat& painted,
                       std::span<const Instance> instances, const NetworkConfig& config);

  NetworkConfig config_;
  Segments last_;
  cv::Mat last_depth_;
  std::vector<InstanceId> of_masks_;
};

// Segments of depth and instances joined.
class JoinedSegments : public Segmenter {
 public:
  // The configs must be valid.
  JoinedSegments(std::shared_ptr<InstanceFinder> finder, const NetworkConfig& network,
                 const DepthSegmentsConfig& depth)
      : finder_(std::move(finder)), config_(network), depth_(depth), known_(network) {}

  // With config.every above 1 what is known is carried over the frames between (KnownSegments).
  // With config.latency above 0 the finder runs beside them on a thread of its own, and what it
  // found in a frame becomes known so many frames later, carried up to there; whoever comes early
  // waits for it. The first frame waits, and one of another size than the last, where all begins
  // anew. Errors: those of DepthSegments and of the finder, whose error comes with the frame in
  // which its instances would.
  Expected<Segments> Segment(const Frame& frame) override;

 private:
  // A frame in which the finder looks for instances, and segments of depth from it on.
  struct Search {
    int frame = 0;
    std::vector<cv::Mat> depth;
    std::future<Expected<std::vector<Instance>>> found;
  };

  Search Begin(const Frame& frame) const;
  Expected<void> Take(Search search);

  std::shared_ptr<InstanceFinder> finder_;
  NetworkConfig config_;
  DepthSegments depth_;
  KnownSegments known_;
  std::optional<Search> search_;
  int frames_ = 0;
};

}  // namespace tsdfpp
