#include "metrics/visibility.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace tsdfpp {
namespace {

// One frame seen by one object's samples.
class DepthTest {
 public:
  DepthTest(const Frame& frame, const Pose& T_WO, InstanceId id, const VisibilityConfig& config)
      : frame_(frame),
        camera_(frame.intrinsics),
        id_(id),
        margin_m_(static_cast<float>(config.margin_m)),
        min_cosine_(
            static_cast<float>(std::cos(config.max_incidence_deg * std::numbers::pi / 180))) {
    const Pose T_CO = frame.T_WC.inverse() * T_WO;
    R_CO_ = T_CO.linear().cast<float>();
    t_CO_ = T_CO.translation().cast<float>();
  }

  SampleStatus operator()(const Eigen::Vector3f& p_O, const Eigen::Vector3f& n_O) const {
    const Eigen::Vector3f p_C = R_CO_ * p_O + t_CO_;
    constexpr float kNearest_m = 1e-3F;
    if (p_C.z() < kNearest_m) return SampleStatus::kOutside;
    const auto u = static_cast<float>(camera_.fx * p_C.x() / p_C.z() + camera_.cx);
    const auto v = static_cast<float>(camera_.fy * p_C.y() / p_C.z() + camera_.cy);
    // The image covers half a pixel beyond the outer pixels' centres.
    if (!(u >= -0.5F && v >= -0.5F && u < static_cast<float>(camera_.width) - 0.5F &&
          v < static_cast<float>(camera_.height) - 0.5F)) {
      return SampleStatus::kOutside;
    }
    const Eigen::Vector3f n_C = R_CO_ * n_O;
    const float height = n_C.dot(p_C);  // of the tangent plane; negative where it faces the camera
    if (height >= 0.0F) return SampleStatus::kBehindItself;

    const int column = static_cast<int>(std::floor(u + 0.5F));
    const int row = static_cast<int>(std::floor(v + 0.5F));
    const float depth = frame_.depth.at<float>(row, column);
    if (!IsValidDepth(depth)) return SampleStatus::kUnmeasured;
    const bool own = frame_.mask.at<std::uint16_t>(row, column) == id_;
    const bool grazing = -height < min_cosine_ * p_C.norm();
    const float expected = PlaneDepth(n_C, height, column, row);
    if (own && !grazing) {
      if (std::abs(depth - expected) <= margin_m_) return SampleStatus::kVisible;
      if (AgreesAround(u, v, n_C, height)) return SampleStatus::kVisible;
    }
    // At grazing incidence on a curved surface the tangent plane may leave for the horizon within
    // half a pixel: the nearer of the two depths is the safe one to call hidden by.
    const float nearer = grazing ? std::min(expected, p_C.z()) : expected;
    if (depth < nearer - margin_m_) {
      return own ? SampleStatus::kBehindItself : SampleStatus::kBehindOther;
    }
    // Another surface drawn at the same depth is in front of this one, or it would not be drawn.
    if (!own && !grazing && depth <= expected + margin_m_) return SampleStatus::kBehindOther;
    return SampleStatus::kUnmeasured;
  }

 private:
  // Depth at which the pixel's ray meets the plane n . x = height; infinite where it does not.
  float PlaneDepth(const Eigen::Vector3f& n_C, float height, int column, int row) const {
    const auto x = static_cast<float>((column - camera_.cx) / camera_.fx);
    const auto y = static_cast<float>((row - camera_.cy) / camera_.fy);
    const float along = n_C.x() * x + n_C.y() * y + n_C.z();
    return along < 0.0F ? height / along : std::numeric_limits<float>::infinity();
  }

  bool AgreesAround(float u, float v, const Eigen::Vector3f& n_C, float height) const {
    const int left = static_cast<int>(std::floor(u));
    const int top = static_cast<int>(std::floor(v));
    for (int row = std::max(top, 0); row <= std::min(top + 1, camera_.height - 1); ++row) {
      for (int column = std::max(left, 0); column <= std::min(left + 1, camera_.width - 1);
           ++column) {
        if (frame_.mask.at<std::uint16_t>(row, column) != id_) continue;
        const float expected = PlaneDepth(n_C, height, column, row);
        if (std::abs(frame_.depth.at<float>(row, column) - expected) <= margin_m_) return true;
      }
    }
    return false;
  }

  const Frame& frame_;
  const Intrinsics& camera_;
  InstanceId id_;
  float margin_m_;
  float min_cosine_;
  Eigen::Matrix3f R_CO_;
  Eigen::Vector3f t_CO_;
};

}  // namespace

SeenTracker::SeenTracker(SampleSet samples_O, InstanceId id, VisibilityConfig config)
    : samples_O_(std::move(samples_O)),
      id_(id),
      config_(config),
      status_(samples_O_.size(), SampleStatus::kOutside),
      observations_(samples_O_.size(), 0) {}

Expected<void> SeenTracker::Observe(const Frame& frame, const Pose& T_WO) {
  const cv::Size size(frame.intrinsics.width, frame.intrinsics.height);
  if (frame.depth.size() != size || frame.depth.type() != CV_32FC1) {
    return DataError("frame {}: depth is {}x{} of OpenCV type {}, expected {}x{} floats",
                     frame.index, frame.depth.cols, frame.depth.rows, frame.depth.type(),
                     size.width, size.height);
  }
  if (frame.mask.size() != size || frame.mask.type() != CV_16UC1) {
    return DataError("frame {}: mask is {}x{} of OpenCV type {}, expected {}x{} 16-bit ids",
                     frame.index, frame.mask.cols, frame.mask.rows, frame.mask.type(), size.width,
                     size.height);
  }
  const DepthTest test(frame, T_WO, id_, config_);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, samples_O_.size(), 4096),
                    [&](const auto& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        status_[i] = test(samples_O_.points[i], samples_O_.normals[i]);
                        if (status_[i] == SampleStatus::kVisible &&
                            observations_[i] < std::numeric_limits<std::uint16_t>::max()) {
                          ++observations_[i];
                        }
                      }
                    });
  return {};
}

}  // namespace tsdfpp
