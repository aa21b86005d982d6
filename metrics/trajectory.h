// Absolute trajectory errors (relative_error.h has the relative ones, object_pose.h those over a
// model's points). Translations in metres, rotations in radians unless named _deg.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/types.h"
#include "metrics/measured.h"

namespace tsdfpp {

using Trajectory = std::map<int, Pose>;  // T_world_object (or camera), by frame number

// The frames that both have, in order.
struct PosePairs {
  std::vector<int> frames;
  std::vector<Pose> estimate;
  std::vector<Pose> truth;
  std::size_t size() const { return frames.size(); }
};
PosePairs PairByFrame(const Trajectory& estimate, const Trajectory& truth);

struct ErrorSummary {
  double rmse = 0;
  double mean = 0;
  double median = 0;  // mean of the two middle values where their number is even
  double standard_deviation = 0;
  double smallest = 0;
  double largest = 0;
  double squares_sum = 0;  // evo's sse
};
// Nothing where there are no errors to summarise.
std::optional<ErrorSummary> SummariseErrors(std::span<const double> errors);

// Pairs with each estimate moved by T * estimate * C; the truth stays.
PosePairs Moved(const PosePairs& pairs, const Pose& T_left, const Pose& C_right);

// Absolute errors a pair, in one common world: |t_est - t_gt|, and the angle
// (0 to pi) of R_est^T R_gt.
std::vector<double> TranslationErrors_m(const PosePairs& pairs);
double RotationAngle_rad(const Eigen::Matrix3d& R);
std::vector<double> RotationErrors_rad(const PosePairs& pairs);

// Both of them summarised; nothing where there are no pairs.
struct PoseErrors {
  ErrorSummary translation_m;
  ErrorSummary rotation_deg;
};
std::optional<PoseErrors> PoseErrorsOf(const PosePairs& pairs);

// The whole pose error a pair, evo's "full transformation": |T_gt^-1 T_est - I|, the Frobenius norm
// of a 4x4 matrix, which mixes metres and rotation and so has no unit.
std::vector<double> FullErrors(const PosePairs& pairs);

// Least-squares truth ~ scale R estimate + t over the translations (Horn 1987, Umeyama 1991); scale
// 1 unless asked for. Needs three pairs; fewer, or translations on one point, give nothing.
struct Alignment {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  double scale = 1;
  // False where the translations of either lie on one line (to 1e-5 of its length): the aligned
  // translations are then defined, but a turn about that line is not, nor any rotation error.
  bool rotation_is_unique = true;
};
std::optional<Alignment> AlignHorn(const PosePairs& pairs, bool with_scale = false);
PosePairs Aligned(const PosePairs& pairs, const Alignment& alignment);

// A mapper chooses an object's frame, so its trajectory is anchored once, at the first common frame
// t0: T_est(t) T_est(t0)^-1 T_gt(t0) (docs/sources.md, "Object trajectories"). No alignment
// follows.
PosePairs AnchoredAtFirst(const PosePairs& pairs);
// The Co-Fusion protocol's anchor C = T_WO_est^-1 T_WC_est T_WC_gt^-1 T_WO_gt at the first common
// frame, with the camera's poses there.
PosePairs AnchoredCoFusion(const PosePairs& pairs, const Pose& T_WC_estimate,
                           const Pose& T_WC_truth);

struct ObjectTrajectoryScores {
  std::size_t frames = 0;
  Measured ate_rmse_m;         // anchored at the first frame, not aligned
  Measured rotation_rmse_deg;  // of the same
  Measured cofusion_rmse_m;    // Co-Fusion protocol: its anchor, Horn alignment, translation RMSE
  Measured rpe_rmse_m;         // from one tracked frame to the next
  Measured rpe_rmse_deg;
};
// Camera poses are those at the first common frame.
ObjectTrajectoryScores ScoreObjectTrajectory(const Trajectory& T_WO_estimate,
                                             const Trajectory& T_WO_truth,
                                             const Pose& T_WC_estimate, const Pose& T_WC_truth);

}  // namespace tsdfpp
