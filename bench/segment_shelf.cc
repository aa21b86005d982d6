#include "bench/segment_shelf.h"

#include <fmt/format.h>

#include "core/pixel_ray.h"
#include "eval/score/label_image.h"
#include "mapper/segment/depth_segments.h"
#include "sequence/open_sequence.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// The bin of the shelf whose objects are labelled, metres in its frame, which the data's scene.json
// puts into the world (T_world_from_bin): from the front edge to the back wall, between the side
// walls, over its floor.
struct Bin {
  Eigen::Matrix4d T_WB;
  Eigen::Vector3d low{-0.01, -0.17, -0.06};
  Eigen::Vector3d high{0.40, 0.17, 0.20};
  Bin() {
    T_WB << 0.999874572, -0.0158379443, 0, 1.4732899,  //
        0.0158379443, 0.999874572, 0, -0.00644825452,  //
        0, 0, 1, 1.0373053,                            //
        0, 0, 0, 1;
  }
};

// The labels, kNoInstance outside of the bin.
cv::Mat InBin(const Frame& frame, const cv::Mat& labels) {
  static const Bin kBin;
  const Pose T_BW(kBin.T_WB.inverse());
  const Pose T_BC = T_BW * frame.T_WC;
  const Intrinsics& k = frame.intrinsics;
  cv::Mat inside = labels.clone();
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      const double z = frame.depth.at<float>(v, u);
      const Eigen::Vector3d ray = PixelRay(k, u, v);
      const Eigen::Vector3d p_B = T_BC * (z * ray);
      const bool is_in =
          (p_B.array() > kBin.low.array()).all() && (p_B.array() < kBin.high.array()).all();
      if (!is_in) inside.at<InstanceId>(v, u) = kNoInstance;
    }
  }
  return inside;
}

// The network's masks: bit k - 1 for object k, of several the lowest counts, as where the data's
// own figures are from.
cv::Mat IdsOfBits(const cv::Mat& bits) {
  cv::Mat ids(bits.size(), CV_16UC1);
  for (int v = 0; v < bits.rows; ++v) {
    for (int u = 0; u < bits.cols; ++u) {
      InstanceId id = kBackground;
      for (InstanceId k = 8; k >= 1; --k) {
        if ((bits.at<std::int32_t>(v, u) >> (k - 1) & 1) != 0) id = k;
      }
      ids.at<InstanceId>(v, u) = id;
    }
  }
  return ids;
}

}  // namespace

Expected<ShelfScores> ScoreShelf(const fs::path& folder) {
  SequenceOptions options;
  options.depth_units_per_m = 10000;
  TSDFPP_ASSIGN(const auto source, OpenSequence(folder, options));
  const SequenceInfo& info = source->info();
  struct Scorers {
    SegmentScorer in_bin;
    SegmentScorer all;
  };
  Scorers depth;
  Scorers network;
  DepthSegments segmenter;
  for (int i = 0; i < info.frame_count; ++i) {
    TSDFPP_ASSIGN(const Frame frame, source->Read(info.first_index + i));
    const auto image = [&](const char* kind) {
      return ReadNumbers(folder / fmt::format("frame-{:06d}.{}.png", frame.index, kind), false);
    };
    TSDFPP_ASSIGN(const cv::Mat labels, image("label"));
    TSDFPP_ASSIGN(const cv::Mat bits, image("pred"));
    if (labels.size() != frame.depth.size() || bits.size() != frame.depth.size()) {
      return DataError("{}: labels or masks of frame {} have another size than its depth",
                       folder.string(), frame.index);
    }
    cv::Mat truth;
    labels.convertTo(truth, CV_16UC1);
    const cv::Mat in_bin = InBin(frame, truth);
    TSDFPP_ASSIGN(const Segments segments, segmenter.Segment(frame));
    const auto observe = [&](Scorers& scorers, const cv::Mat& ids) -> Expected<void> {
      TSDFPP_RETURN_IF_ERROR(scorers.in_bin.Observe(in_bin, ids, frame.depth));
      return scorers.all.Observe(truth, ids, frame.depth);
    };
    TSDFPP_RETURN_IF_ERROR(observe(depth, segments.ids));
    TSDFPP_RETURN_IF_ERROR(observe(network, IdsOfBits(bits)));
  }
  return ShelfScores{{depth.in_bin.Result(), depth.all.Result()},
                     {network.in_bin.Result(), network.all.Result()}};
}

}  // namespace tsdfpp
