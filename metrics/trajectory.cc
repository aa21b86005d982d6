#include "metrics/trajectory.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/units.h"
#include "metrics/relative_error.h"

namespace tsdfpp {
namespace {

// Whether the points (whose mean is zero) are within 1e-5 of their extent of a line.
bool OnOneLine(const Eigen::Matrix3Xd& centred) {
  constexpr double kThinnest = 1e-5;
  const Eigen::Matrix3d scatter = centred * centred.transpose();
  const Eigen::Vector3d increasing =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues();
  return increasing[1] <= kThinnest * kThinnest * increasing[2];
}

Measured RmseOf(const std::vector<double>& errors, double unit, const char* why_empty) {
  const auto summary = SummariseErrors(errors);
  return summary ? Measured::Of(summary->rmse * unit) : Measured::Undefined(why_empty);
}

}  // namespace

PosePairs PairByFrame(const Trajectory& estimate, const Trajectory& truth) {
  PosePairs pairs;
  for (const auto& [frame, pose] : estimate) {
    const auto match = truth.find(frame);
    if (match == truth.end()) continue;
    pairs.frames.push_back(frame);
    pairs.estimate.push_back(pose);
    pairs.truth.push_back(match->second);
  }
  return pairs;
}

std::optional<ErrorSummary> SummariseErrors(std::span<const double> errors) {
  if (errors.empty()) return std::nullopt;
  const auto count = static_cast<double>(errors.size());
  std::vector<double> sorted(errors.begin(), errors.end());
  std::sort(sorted.begin(), sorted.end());
  ErrorSummary summary;
  summary.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / count;
  double squares = 0;
  double deviations = 0;
  for (const double error : errors) {
    squares += error * error;
    deviations += (error - summary.mean) * (error - summary.mean);
  }
  summary.rmse = std::sqrt(squares / count);
  summary.standard_deviation = std::sqrt(deviations / count);
  const std::size_t middle = sorted.size() / 2;
  summary.median =
      sorted.size() % 2 == 1 ? sorted[middle] : 0.5 * (sorted[middle - 1] + sorted[middle]);
  summary.smallest = sorted.front();
  summary.largest = sorted.back();
  summary.squares_sum = squares;
  return summary;
}

PosePairs Moved(const PosePairs& pairs, const Pose& T_left, const Pose& C_right) {
  PosePairs out = pairs;
  for (Pose& pose : out.estimate) pose = T_left * pose * C_right;
  return out;
}

std::vector<double> TranslationErrors_m(const PosePairs& pairs) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    errors.push_back((pairs.estimate[i].translation() - pairs.truth[i].translation()).norm());
  }
  return errors;
}

std::vector<double> RotationErrors_rad(const PosePairs& pairs) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    errors.push_back(
        RotationAngle_rad(pairs.estimate[i].linear().transpose() * pairs.truth[i].linear()));
  }
  return errors;
}

double RotationAngle_rad(const Eigen::Matrix3d& R) {
  return std::abs(Eigen::AngleAxisd(Eigen::Quaterniond(R).normalized()).angle());
}

std::optional<PoseErrors> PoseErrorsOf(const PosePairs& pairs) {
  std::vector<double> degrees = RotationErrors_rad(pairs);
  for (double& angle : degrees) angle *= 180 / std::numbers::pi;
  const auto translation_m = SummariseErrors(TranslationErrors_m(pairs));
  const auto rotation_deg = SummariseErrors(degrees);
  if (!translation_m || !rotation_deg) return std::nullopt;
  return PoseErrors{*translation_m, *rotation_deg};
}

std::vector<double> FullErrors(const PosePairs& pairs) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Matrix4d E = (pairs.truth[i].inverse() * pairs.estimate[i]).matrix();
    errors.push_back((E - Eigen::Matrix4d::Identity()).norm());
  }
  return errors;
}

std::optional<Alignment> AlignHorn(const PosePairs& pairs, bool with_scale) {
  constexpr std::size_t kFewest = 3;
  if (pairs.size() < kFewest) return std::nullopt;
  Eigen::Matrix3Xd from(3, pairs.size());
  Eigen::Matrix3Xd to(3, pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs.estimate[i].translation();
    to.col(static_cast<Eigen::Index>(i)) = pairs.truth[i].translation();
  }
  const Eigen::Matrix3Xd from_centred = from.colwise() - from.rowwise().mean();
  const Eigen::Matrix3Xd to_centred = to.colwise() - to.rowwise().mean();
  if (from_centred.squaredNorm() == 0) return std::nullopt;
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, with_scale);
  Alignment alignment;
  if (with_scale) alignment.scale = T.block<3, 1>(0, 0).norm();
  // A truth that stands still: any estimate fits best as a single point.
  if (!(alignment.scale > 0)) return std::nullopt;
  alignment.R = T.topLeftCorner<3, 3>() / alignment.scale;
  alignment.rotation_is_unique = !OnOneLine(from_centred) && !OnOneLine(to_centred);
  alignment.t = T.topRightCorner<3, 1>();
  return alignment;
}

PosePairs Aligned(const PosePairs& pairs, const Alignment& alignment) {
  PosePairs out = pairs;
  for (Pose& pose : out.estimate) {
    pose.translation() = (alignment.scale * alignment.R * pose.translation() + alignment.t).eval();
    pose.linear() = (alignment.R * pose.linear()).eval();
  }
  return out;
}

PosePairs AnchoredAtFirst(const PosePairs& pairs) {
  if (pairs.size() == 0) return pairs;
  return Moved(pairs, Pose::Identity(), pairs.estimate.front().inverse() * pairs.truth.front());
}

PosePairs AnchoredCoFusion(const PosePairs& pairs, const Pose& T_WC_estimate,
                           const Pose& T_WC_truth) {
  if (pairs.size() == 0) return pairs;
  const Pose C =
      pairs.estimate.front().inverse() * T_WC_estimate * T_WC_truth.inverse() * pairs.truth.front();
  return Moved(pairs, Pose::Identity(), C);
}

ObjectTrajectoryScores ScoreObjectTrajectory(const Trajectory& T_WO_estimate,
                                             const Trajectory& T_WO_truth,
                                             const Pose& T_WC_estimate, const Pose& T_WC_truth) {
  const PosePairs pairs = PairByFrame(T_WO_estimate, T_WO_truth);
  const PosePairs anchored = AnchoredAtFirst(pairs);
  const RelativeErrors relative = RelativePoseErrors(anchored, 1);
  const char* untracked = "the object was never tracked";
  ObjectTrajectoryScores scores;
  scores.frames = pairs.size();
  scores.ate_rmse_m = RmseOf(TranslationErrors_m(anchored), 1, untracked);
  scores.rotation_rmse_deg = RmseOf(RotationErrors_rad(anchored), kDegPerRad, untracked);
  scores.rpe_rmse_m = RmseOf(relative.translation_m, 1, "fewer than two tracked frames");
  scores.rpe_rmse_deg = RmseOf(relative.rotation_rad, kDegPerRad, "fewer than two tracked frames");
  const PosePairs cofusion = AnchoredCoFusion(pairs, T_WC_estimate, T_WC_truth);
  const auto alignment = AlignHorn(cofusion);
  scores.cofusion_rmse_m =
      alignment ? RmseOf(TranslationErrors_m(Aligned(cofusion, *alignment)), 1, untracked)
                : Measured::Undefined("Horn alignment needs three tracked frames and motion");
  return scores;
}

}  // namespace tsdfpp
