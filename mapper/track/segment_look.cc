#include "mapper/track/segment_look.h"

#include <algorithm>

#include "mapper/segment/components.h"

namespace tsdfpp {
namespace {

// Depth that is nearer by so many voxels is of something else.
constexpr double kNearer_voxels = 3;
// A segment that comes nearer to the picture's edge goes on outside.
constexpr int kEdge_px = 3;
// So much of a segment's outline may be beside something nearer.
constexpr double kMostCovered = 0.1;
constexpr int kMostPoints = 1500;  // of a segment, to say where it is
// A segment whose rectangle has more pixels than so many times its own is no thing.
constexpr double kMostSpread = 100;

// A segment's pixels within the rectangle around them and a margin; 255, else 0.
struct CutOut {
  cv::Mat inside;
  cv::Point corner;  // in the image, or beside it
};
constexpr int kBeyond_px = 2;

CutOut CutOutOf(const LoosePixels& pixels, const cv::Rect& around, int columns) {
  const cv::Point margin(kBeyond_px, kBeyond_px);
  CutOut cut{cv::Mat::zeros(around.size() + cv::Size(2 * margin), CV_8UC1), around.tl() - margin};
  for (const int pixel : pixels) {
    cut.inside.at<std::uint8_t>(cv::Point(pixel % columns, pixel / columns) - cut.corner) = 255;
  }
  return cut;
}

// Whether its outline comes near the picture's edge, beyond which the rest of it may be.
bool ReachesTheEdge(const CutOut& cut, const cv::Size& size) {
  const cv::Rect around(cut.corner + cv::Point(kBeyond_px, kBeyond_px),
                        cut.inside.size() - cv::Size(2 * kBeyond_px, 2 * kBeyond_px));
  return std::min({around.x, around.y, size.width - around.br().x, size.height - around.br().y}) <
         kEdge_px;
}

// Whether much of its outline is beside something nearer.
bool IsCovered(const Frame& frame, const CutOut& cut, double voxel_m) {
  const cv::Rect image(cv::Point(), frame.depth.size());
  int outline = 0;
  int covered = 0;
  for (int v = kBeyond_px; v < cut.inside.rows - kBeyond_px; ++v) {
    for (int u = kBeyond_px; u < cut.inside.cols - kBeyond_px; ++u) {
      const cv::Point own(u, v);
      if (cut.inside.at<std::uint8_t>(own) == 0) continue;
      const float z = frame.depth.at<float>(own + cut.corner);
      for (const cv::Point step : {cv::Point(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
        if (cut.inside.at<std::uint8_t>(own + step) != 0) continue;
        ++outline;
        const cv::Point beyond = own + kBeyond_px * step + cut.corner;
        if (!image.contains(beyond)) continue;
        const float beside = frame.depth.at<float>(beyond);
        if (IsValidDepth(beside) && double{beside} < double{z} - kNearer_voxels * voxel_m) {
          ++covered;
        }
      }
    }
  }
  return covered > kMostCovered * outline;
}

}  // namespace

SegmentLook LookAtSegment(const Frame& frame, const LoosePixels& pixels, double voxel_m,
                          const SdfTrackConfig& config) {
  SegmentLook look;
  SdfTrackConfig few = config;
  few.max_points = std::min(few.max_points, kMostPoints);
  look.points = SegmentPointsOf(frame, pixels, voxel_m, few);
  look.is_large =
      look.points.size() >= static_cast<std::size_t>(std::min(config.min_points, kMostPoints));
  if (!look.is_large) return look;
  look.appearance = AppearanceOf(frame, look.points);
  const cv::Rect around = RectangleOf(pixels, frame.depth.cols);
  if (around.area() > kMostSpread * static_cast<double>(pixels.size())) {
    look.is_at_edge = true;
    return look;
  }
  const CutOut cut = CutOutOf(pixels, around, frame.depth.cols);
  look.is_at_edge = ReachesTheEdge(cut, frame.depth.size());
  look.is_covered = IsCovered(frame, cut, voxel_m);
  return look;
}

}  // namespace tsdfpp
