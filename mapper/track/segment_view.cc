#include "mapper/track/segment_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace tsdfpp {
namespace {

// Beside the segment: further an object does not come between two passes.
constexpr int kMargin_px = 24;
// Across an outline depth is asked for so far from it: nearer it may be mixed.
constexpr double kBeside_px = 2;
// Between there and here it tells whether the surface turns away.
constexpr double kInside_px = 6;
// And so far along the outline, to both sides.
constexpr int kAlong_px = 3;
// Of the angle between a surface and the plane of the image: what turns away is steeper.
constexpr double kSteepest = 1;
// Grey values are smoothed, and nearer to the outline they are mixed with what is behind.
constexpr double kSmooth_px = 1;
constexpr double kPure_px = 3;

cv::Rect Around(const cv::Mat& is_own) {
  const cv::Rect box = cv::boundingRect(is_own);
  const cv::Rect wide(box.x - kMargin_px, box.y - kMargin_px, box.width + 2 * kMargin_px,
                      box.height + 2 * kMargin_px);
  return wide & cv::Rect(0, 0, is_own.cols, is_own.rows);
}

// CV_32FC1: to the nearest pixel that is not 0.
cv::Mat DistanceTo(const cv::Mat& pixels) {
  cv::Mat distance;
  cv::distanceTransform(pixels == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return distance;
}

// Negative inside, 0 half a pixel beside the pixels at the outline.
cv::Mat SignedDistance(const cv::Mat& is_own) {
  const cv::Mat from_outside = DistanceTo(is_own);
  const cv::Mat from_inside = DistanceTo(is_own == 0);
  cv::Mat distance = from_outside - from_inside;
  cv::subtract(distance, 0.5, distance, is_own == 0);
  cv::add(distance, 0.5, distance, is_own);
  return distance;
}

cv::Mat OutlineOf(const cv::Mat& labels, InstanceId id) {
  cv::Mat is_own = labels == static_cast<double>(id);
  const cv::Mat is_open = labels == static_cast<double>(kNoInstance);
  const cv::Mat is_other = ~(is_own | is_open);
  if (cv::countNonZero(is_other) == 0) return {};
  if (cv::countNonZero(is_open) > 0) {
    const cv::Mat is_nearer = DistanceTo(is_own) <= DistanceTo(is_other);
    is_own |= is_open & is_nearer;
  }
  return SignedDistance(is_own);
}

cv::Mat GreyOf(const cv::Mat& colour) {
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_RGB2GRAY);
  grey.convertTo(grey, CV_32F);
  cv::GaussianBlur(grey, grey, {}, kSmooth_px, kSmooth_px, cv::BORDER_REPLICATE);
  return grey;
}

}  // namespace

SegmentView::SegmentView(const Frame& frame, const cv::Mat& labels, InstanceId id, double step_m,
                         bool has_colour)
    : frame_(&frame),
      step_m_(step_m),
      window_(Around(labels == static_cast<double>(id))),
      outline_(OutlineOf(labels(window_), id)) {
  if (has_colour && frame.colour.size() == labels.size()) grey_ = GreyOf(frame.colour(window_));
}

ImageValue SegmentView::ValueAt(const cv::Mat& image, const Eigen::Vector2d& pixel) const {
  ImageValue at;
  const double x = pixel.x() - window_.x;
  const double y = pixel.y() - window_.y;
  if (!(x >= 0 && y >= 0 && x < image.cols - 1 && y < image.rows - 1)) return at;
  const int u = static_cast<int>(x);
  const int v = static_cast<int>(y);
  const double fx = x - u;
  const double fy = y - v;
  const auto* above = image.ptr<float>(v) + u;
  const auto* below = image.ptr<float>(v + 1) + u;
  const double along_above = double{above[1]} - above[0];
  const double along_below = double{below[1]} - below[0];
  const double top = above[0] + fx * along_above;
  const double bottom = below[0] + fx * along_below;
  at.is_known = true;
  at.value = top + fy * (bottom - top);
  at.slope = {along_above + fy * (along_below - along_above), bottom - top};
  return at;
}

ImageValue SegmentView::OutlineAt(const Eigen::Vector2d& pixel) const {
  return ValueAt(outline_, pixel);
}

ImageValue SegmentView::GreyAt(const Eigen::Vector2d& pixel) const {
  const ImageValue outline = OutlineAt(pixel);
  // Where there is no outline, all is inside.
  if (!outline_.empty() && !(outline.is_known && outline.value <= -kPure_px)) return {};
  return ValueAt(grey_, pixel);
}

double SegmentView::DepthAt(const Eigen::Vector2d& pixel) const {
  const cv::Mat& depth = frame_->depth;
  const double u = std::floor(pixel.x() + 0.5);
  const double v = std::floor(pixel.y() + 0.5);
  if (!(u >= 0 && v >= 0 && u < depth.cols && v < depth.rows)) return 0;
  const float depth_m = depth.at<float>(static_cast<int>(v), static_cast<int>(u));
  return IsValidDepth(depth_m) ? double{depth_m} : 0;
}

bool SegmentView::IsAtDepth(const Eigen::Vector2d& pixel, double depth_m) const {
  const double there_m = DepthAt(pixel);
  return there_m > 0 && std::abs(there_m - depth_m) <= step_m_;
}

bool SegmentView::IsOutlineOf(const Eigen::Vector2d& pixel, double depth_m) const {
  const ImageValue at = OutlineAt(pixel);
  const double length = at.slope.norm();
  if (!at.is_known || !(length > 0)) return false;
  const Eigen::Vector2d outwards = at.slope / length;
  const Eigen::Vector2d nearest = pixel - at.value * outwards;
  const double inside_m = DepthAt(nearest - kBeside_px * outwards);
  const double outside_m = DepthAt(nearest + kBeside_px * outwards);
  return inside_m > 0 && std::abs(inside_m - depth_m) <= step_m_ && outside_m > inside_m + step_m_;
}

std::optional<double> SegmentView::RimDepth(const Eigen::Vector2d& pixel,
                                            const Eigen::Vector2d& outwards) const {
  const double beside_m = DepthAt(pixel - kBeside_px * outwards);
  const double inside_m = DepthAt(pixel - kInside_px * outwards);
  if (!(beside_m > 0) || !(inside_m > 0)) return std::nullopt;
  // By the pixels along the outline, too: with noise single ones make edges of a ball.
  const Eigen::Vector2d along(-outwards.y(), outwards.x());
  double sum_m = 0;
  int count = 0;
  for (int step = -kAlong_px; step <= kAlong_px; ++step) {
    const double near_m = DepthAt(pixel - kBeside_px * outwards + step * along);
    const double far_m = DepthAt(pixel - kInside_px * outwards + step * along);
    if (!(near_m > 0) || !(far_m > 0) || std::abs(near_m - beside_m) > step_m_ ||
        std::abs(far_m - inside_m) > step_m_) {
      continue;
    }
    sum_m += far_m - near_m;
    ++count;
  }
  const double pixels_per_m = std::max(frame_->intrinsics.fx, frame_->intrinsics.fy);
  const double run_m = (kInside_px - kBeside_px) * beside_m / pixels_per_m;
  if (count == 0 || std::abs(sum_m) > kSteepest * run_m * count) return std::nullopt;
  // Straight on up to the rim, as a plane goes on in inverse depth ...
  const double steps = (kBeside_px + 0.5) / (kInside_px - kBeside_px);
  const double plane_m = 1 / (1 / beside_m + steps * (1 / beside_m - 1 / inside_m));
  // ... but an edge is round: what makes the outline lies farther back than that, and seen from
  // another side it would be beside the outline.
  const double last_m = DepthAt(pixel);
  const double next_m = DepthAt(pixel - outwards);
  if (!(last_m > 0) || !(next_m > 0) || std::abs(last_m - plane_m) > step_m_) return plane_m;
  return last_m + 0.5 * std::max(0.0, last_m - next_m);
}

std::vector<RimPoint> SegmentView::Rim() const {
  std::vector<RimPoint> rim;
  for (int v = 1; v < outline_.rows - 1; ++v) {
    const auto* row = outline_.ptr<float>(v);
    for (int u = 1; u < outline_.cols - 1; ++u) {
      if (row[u] != -0.5F) continue;  // the pixels at the outline
      const Eigen::Vector2d pixel(u + window_.x, v + window_.y);
      // Over two pixels: beside an outline of whole pixels one alone points along a row or column.
      const Eigen::Vector2d slope(
          (row[u + 1] - row[u - 1]) / 2,
          (outline_.at<float>(v + 1, u) - outline_.at<float>(v - 1, u)) / 2);
      const double length = slope.norm();
      if (!(length > 0.5)) continue;
      const Eigen::Vector2d outwards = slope / length;
      const auto depth_m = RimDepth(pixel, outwards);
      if (!depth_m) continue;
      const RimPoint point{pixel + 0.5 * outwards, *depth_m, outwards};
      if (IsOutlineOf(point.pixel, point.depth_m)) rim.push_back(point);
    }
  }
  return rim;
}

}  // namespace tsdfpp
