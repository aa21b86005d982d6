// How surfaces face the camera: against planes of which all is known.
#include "mapper/volume/facing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "core/random.h"

namespace tsdfpp {
namespace {

constexpr int kWidth = 60;
constexpr int kHeight = 48;
constexpr double kFocal_px = 300;
constexpr InstanceId kBox = 3;
constexpr double kOblique = 0.7071067811865476;  // of 45 degrees
// Depths are floats of some 0.6 m, over three pixels.
constexpr double kExact = 2e-3;

Eigen::Vector3d RayOf(int v, int u) {
  return {(u - kWidth / 2.0) / kFocal_px, (v - kHeight / 2.0) / kFocal_px, 1};
}

// What a fit of 49 pixels leaves of the noise below, and a little for those at the picture's rim.
constexpr double kNoisy = 0.12;

// A frame whose depth along the ray of row v, column u is that.
Frame FrameOf(const std::function<double(int v, int u)>& depth) {
  Frame frame;
  frame.intrinsics = {kWidth, kHeight, kFocal_px, kFocal_px, kWidth / 2.0, kHeight / 2.0};
  frame.depth = cv::Mat(kHeight, kWidth, CV_32FC1);
  frame.colour = cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(0, 0, 0));
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      frame.depth.at<float>(v, u) = static_cast<float>(depth(v, u));
    }
  }
  return frame;
}

cv::Mat AllOf(InstanceId id) { return cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(id)); }

// Turned from the camera about the picture's rows by so many degrees, 0.6 m away in the middle.
struct Tilted {
  explicit Tilted(double degrees)
      : normal(std::sin(degrees * EIGEN_PI / 180), 0, -std::cos(degrees * EIGEN_PI / 180)) {}
  double DepthAt(int v, int u) const { return 0.6 * normal.z() / normal.dot(RayOf(v, u)); }
  double CosineAt(int v, int u) const { return -normal.dot(RayOf(v, u).normalized()); }
  double FacingAt(int v, int u) const { return std::min(1.0, CosineAt(v, u) / kOblique); }
  Eigen::Vector3d normal;
};

TEST(Facing, IsThatOfPlanes) {
  for (const double degrees : {0.0, 30.0, 44.0, 50.0, 60.0, -70.0, 78.0}) {
    const Tilted plane(degrees);
    const Frame frame = FrameOf([&](int v, int u) { return plane.DepthAt(v, u); });
    const cv::Mat facing = FacingOf(frame, AllOf(kBox));
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        ASSERT_NEAR(facing.at<float>(v, u), plane.FacingAt(v, u), kExact)
            << degrees << " degrees, row " << v << ", column " << u;
      }
    }
  }
}

// Noise of which the mean of a plane is known to a few hundredths, also where it grows with the
// angle, as a sensor's does: 2 mm, and half a pixel aside.
TEST(Facing, IsThatOfPlanesInNoise) {
  for (const double degrees : {60.0, 75.0}) {
    const Tilted plane(degrees);
    const Frame frame = FrameOf([&](int v, int u) {
      const auto draw = GaussianDraw(5, 1, static_cast<std::uint64_t>(kWidth * v + u));
      const double aside = 0.5 * draw[0];
      const double slope = plane.DepthAt(v, u + 1) - plane.DepthAt(v, u);
      return plane.DepthAt(v, u) + aside * slope + 0.002 * draw[1];
    });
    const cv::Mat facing = FacingOf(frame, AllOf(kBox));
    double squares = 0;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const double off = facing.at<float>(v, u) - plane.FacingAt(v, u);
        squares += off * off;
      }
    }
    EXPECT_LT(std::sqrt(squares / (kWidth * kHeight)), kNoisy) << degrees;
  }
}

// Two sides of a box, one of 20 and one of 70 degrees: up to the edge each is its own, but for what
// is beside it, which is between both.
TEST(Facing, EndsAtAnEdge) {
  const Tilted left(20);
  const Tilted right(-70);
  const Frame frame =
      FrameOf([&](int v, int u) { return std::max(left.DepthAt(v, u), right.DepthAt(v, u)); });
  const cv::Mat facing = FacingOf(frame, AllOf(kBox));
  constexpr int kEdge = kWidth / 2;
  int left_count = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const bool is_left = left.DepthAt(v, u) >= right.DepthAt(v, u);
      left_count += is_left ? 1 : 0;
      const double own = (is_left ? left : right).FacingAt(v, u);
      const double off = std::abs(facing.at<float>(v, u) - own);
      if (std::abs(u - kEdge) > 1) {
        ASSERT_LT(off, kExact) << "row " << v << ", column " << u;
      } else {
        ASSERT_LE(facing.at<float>(v, u), 1);
        ASSERT_GE(facing.at<float>(v, u), right.FacingAt(v, u) - kExact);
      }
    }
  }
  EXPECT_GT(left_count, kWidth * kHeight / 3);
  EXPECT_LT(left_count, kWidth * kHeight * 2 / 3);
}

// What stands before it, with the same label or with another, does not turn its normal.
TEST(Facing, EndsAtAStep) {
  const Tilted plane(65);
  const Frame frame = FrameOf([&](int v, int u) { return u < 25 ? 0.3 : plane.DepthAt(v, u); });
  for (const bool two : {false, true}) {
    cv::Mat labels = AllOf(kBox);
    if (two) labels.colRange(0, 25).setTo(kBox + 1);
    const cv::Mat facing = FacingOf(frame, labels);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const double expected = u < 25 ? 1 : plane.FacingAt(v, u);
        ASSERT_NEAR(facing.at<float>(v, u), expected, kExact) << v << " " << u << " " << two;
      }
    }
  }
}

TEST(Facing, IsOneWhereNothingIsKnown) {
  const Tilted plane(70);
  const Frame frame = FrameOf([&](int v, int u) {
    return v < 10 ? 0 : v < 12 ? std::nan("") : plane.DepthAt(v, u);
  });
  cv::Mat labels = AllOf(kBox);
  labels.rowRange(20, 30).setTo(kBackground);
  labels.rowRange(30, 40).setTo(kNoInstance);
  const cv::Mat facing = FacingOf(frame, labels);
  for (int v = 0; v < kHeight; ++v) {
    const bool is_known = (v >= 12 && v < 20) || v >= 40;
    for (int u = 0; u < kWidth; ++u) {
      ASSERT_NEAR(facing.at<float>(v, u), is_known ? plane.FacingAt(v, u) : 1, kExact) << v;
    }
  }
  double least = 0;
  const Frame empty = FrameOf([](int, int) { return -std::numeric_limits<double>::infinity(); });
  cv::minMaxLoc(FacingOf(empty, AllOf(kBox)), &least);
  EXPECT_EQ(least, 1);
}

// What is round has no plane; where so little of it is seen that it seems to, the plane is its own.
TEST(Facing, IsThatOfABallOrOne) {
  constexpr double kRadius_m = 0.04;
  constexpr double kRound = 0.25;  // a quarter lies two pixels aside, near the outline
  const Eigen::Vector3d centre(0, 0, 0.3);
  const auto seen = [&](int v, int u) -> std::optional<Eigen::Vector3d> {
    const Eigen::Vector3d ray = RayOf(v, u).normalized();
    const double along = ray.dot(centre);
    const double within = kRadius_m * kRadius_m - (centre.squaredNorm() - along * along);
    if (within <= 0) return std::nullopt;
    return (along - std::sqrt(within)) * ray;
  };
  const Frame frame = FrameOf([&](int v, int u) {
    const auto point = seen(v, u);
    return point ? point->z() : 0;
  });
  const cv::Mat facing = FacingOf(frame, AllOf(kBox));
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto point = seen(v, u);
      if (!point || facing.at<float>(v, u) == 1) continue;
      const double cosine = -(*point - centre).normalized().dot(point->normalized());
      ASSERT_NEAR(facing.at<float>(v, u), std::min(1.0, cosine / kOblique), kRound)
          << v << " " << u;
    }
  }
}

}  // namespace
}  // namespace tsdfpp
