#include "mapper/associate/far_part.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/pixel_ray.h"
#include "mapper/segment/components.h"

namespace tsdfpp {
namespace {

// Of a part's points; the others may be noise at its outline.
constexpr double kLeastOutside = 0.95;
// A part that comes nearer to the picture's edge goes on outside.
constexpr int kEdge_px = 3;
// So much of an outline may be beside something nearer, which is looked for so far beyond it: depth
// is missing beside outlines.
constexpr double kMostCovered = 0.1;
constexpr int kBeyond_px = 6;

// A segment's pixels within the rectangle around them.
class CutOutSegment {
 public:
  CutOutSegment(const Frame& frame, const cv::Mat& ids, std::span<const int> pixels)
      : frame_(frame),
        ids_(ids),
        pixels_(pixels),
        around_(RectangleOf(pixels, frame.depth.cols)),
        member_(cv::Mat::zeros(around_.size(), CV_8UC1)) {
    for (const int pixel : pixels_) member_.at<std::uint8_t>(PlaceOf(pixel)) = 255;
  }

  cv::Point PlaceOf(int pixel) const {
    return cv::Point(pixel % frame_.depth.cols, pixel / frame_.depth.cols) - around_.tl();
  }

  // CV_32SC1, from 1 on, and the number after the last.
  std::int32_t LabelParts(double step_m, cv::Mat& parts) const {
    const cv::Mat depth = frame_.depth(around_);
    cv::Mat right(around_.size(), CV_8UC1, cv::Scalar(0));
    cv::Mat down(around_.size(), CV_8UC1, cv::Scalar(0));
    const auto is_linked = [&](const cv::Point& a, const cv::Point& b) {
      return std::abs(double{depth.at<float>(a)} - double{depth.at<float>(b)}) <= step_m;
    };
    for (const int pixel : pixels_) {
      const cv::Point own = PlaceOf(pixel);
      const cv::Point beside = own + cv::Point(1, 0);
      const cv::Point below = own + cv::Point(0, 1);
      right.at<std::uint8_t>(own) = beside.x < depth.cols && is_linked(own, beside) ? 255 : 0;
      down.at<std::uint8_t>(own) = below.y < depth.rows && is_linked(own, below) ? 255 : 0;
    }
    parts = cv::Mat::zeros(around_.size(), CV_32SC1);
    return LabelComponents(member_, {right, down}, 1, parts);
  }

  // Whether the part of a pixel ends there, but for the picture's edge: in how many directions, and
  // in how many of those beside something nearer that is not of the segment.
  struct End {
    int all = 0;
    int covered = 0;
  };
  End EndAt(const cv::Mat& parts, int pixel, double step_m) const {
    const cv::Point own = PlaceOf(pixel);
    const auto part = parts.at<std::int32_t>(own);
    End end;
    for (const cv::Point step : {cv::Point(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
      const cv::Point next = own + step;
      if (IsInside(next) && parts.at<std::int32_t>(next) == part) continue;
      ++end.all;
      if (IsNearerBeyond(own, step, step_m)) ++end.covered;
    }
    return end;
  }

  bool IsAtEdge(int pixel) const {
    const cv::Rect inner(kEdge_px, kEdge_px, frame_.depth.cols - 2 * kEdge_px,
                         frame_.depth.rows - 2 * kEdge_px);
    return !inner.contains(PlaceOf(pixel) + around_.tl());
  }

 private:
  bool IsInside(const cv::Point& place) const {
    return cv::Rect(cv::Point(), around_.size()).contains(place);
  }

  // Whether the first thing beyond an outline is nearer, and not of the segment.
  bool IsNearerBeyond(const cv::Point& own, const cv::Point& step, double step_m) const {
    const cv::Rect image(cv::Point(), frame_.depth.size());
    const double z = frame_.depth.at<float>(own + around_.tl());
    bool is_nearer = false;
    for (int i = 1; i <= kBeyond_px; ++i) {
      const cv::Point place = own + i * step;
      const cv::Point pixel = place + around_.tl();
      if (!image.contains(pixel)) return false;
      if (IsInside(place) && member_.at<std::uint8_t>(place) != 0) return false;
      const float beside = frame_.depth.at<float>(pixel);
      if (!IsValidDepth(beside) || double{beside} >= z - step_m) continue;
      is_nearer = true;
      // Of nobody are outlines, the segment's own, too.
      if (ids_.at<InstanceId>(pixel) != kNoInstance) break;
    }
    return is_nearer;
  }

  const Frame& frame_;
  const cv::Mat& ids_;
  std::span<const int> pixels_;
  cv::Rect around_;
  cv::Mat member_;
};

struct Part {
  int pixels = 0;
  int outside = 0;
  int outline = 0;
  int covered = 0;
  bool is_at_edge = false;
  bool IsOutside() const { return outside >= kLeastOutside * pixels; }
  bool MayGoOn() const { return is_at_edge || covered > kMostCovered * outline; }
};

}  // namespace

std::vector<int> FindFarPart(const Frame& frame, const cv::Mat& ids, std::span<const int> pixels,
                             const ObjectLookup::SurfaceBox& known, const FarPartConfig& config) {
  if (pixels.empty() || known.box_L.isEmpty()) return {};
  const double grow_m = std::max(config.least_m, config.share * known.box_L.diagonal().norm());
  const Eigen::Vector3d rim = Eigen::Vector3d::Constant(grow_m);
  const Eigen::AlignedBox3d near_L(known.box_L.min() - rim, known.box_L.max() + rim);

  const CutOutSegment segment(frame, ids, pixels);
  cv::Mat parts;
  std::vector<Part> of(static_cast<std::size_t>(segment.LabelParts(config.step_m, parts)));
  const auto part_of = [&](int pixel) -> Part& {
    return of[static_cast<std::size_t>(parts.at<std::int32_t>(segment.PlaceOf(pixel)))];
  };
  for (const int pixel : pixels) {
    const int v = pixel / frame.depth.cols;
    const int u = pixel % frame.depth.cols;
    const double z = frame.depth.at<float>(v, u);
    const Eigen::Vector3d p_L = known.T_LW * (frame.T_WC * (z * PixelRay(frame.intrinsics, u, v)));
    Part& part = part_of(pixel);
    ++part.pixels;
    if (!near_L.contains(p_L)) ++part.outside;
  }
  for (const int pixel : pixels) {
    Part& part = part_of(pixel);
    if (!part.IsOutside() || part.pixels < config.least_pixels) continue;
    const CutOutSegment::End end = segment.EndAt(parts, pixel, config.step_m);
    part.outline += end.all;
    part.covered += end.covered;
    part.is_at_edge |= segment.IsAtEdge(pixel);
  }
  std::vector<int> far;
  std::ranges::copy_if(pixels, std::back_inserter(far), [&](int pixel) {
    return part_of(pixel).IsOutside() && !part_of(pixel).MayGoOn();
  });
  return far;
}

}  // namespace tsdfpp
