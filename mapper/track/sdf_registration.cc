#include "mapper/track/sdf_registration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace tsdfpp {
namespace {

// Segments smaller than this say nothing about a turn, but a length is needed all the same.
constexpr double kLeastRadius_voxels = 1;
// A deviation that is taken for real, voxels: exact data would else make outliers of every edge.
constexpr double kLeastDeviation_voxels = 0.02;
// A search that ran out of iterations is as good as settled where its steps are no longer than
// this. While many points are outliers Huber's function makes steps short and of one length; an
// object that was refused for it, step by step the same, was lost where it was pushed along.
constexpr double kNearlySettled_voxels = 0.1;

// About the segment's centroid, with the root of the mean squared distance from it as radius.
MotionFrame FrameOf(const SdfRegistration& task) {
  MotionFrame frame;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0;
  for (const SegmentPoint& point : task.points) sum += point.p_C.cast<double>();
  const auto count = static_cast<double>(task.points.size());
  const Eigen::Vector3d centre_C = sum / count;
  for (const SegmentPoint& point : task.points) {
    squares += (point.p_C.cast<double>() - centre_C).squaredNorm();
  }
  frame.centre = task.T_LC_expected * centre_C;
  frame.radius_m = std::max(std::sqrt(squares / count), kLeastRadius_voxels * task.voxel_m);
  return frame;
}

// Of points with a deviation of this or more a direction is weak up to config.weak_share, of those
// with half of it or less up to half of that.
constexpr double kWeakDeviation_voxels = 0.1;
constexpr double kLeastOfWeakShare = 0.5;

// Of the mean information: keeps directions of which nothing speaks from dividing by nothing.
constexpr double kNoShare = 1e-9;

// A direction is known by other terms than the distances where they leave less open.
constexpr double kKnownOtherwise_voxels = 0.05;
// Along directions of which distances know a smaller share, what they know is for the most part
// what is wrong with a model's rim. Other terms that know such a direction have that share of say.
constexpr double kWeakOfDistances = 0.2;
// The outline has a say along shifts of which distances know a smaller share than this, and has
// them up to it. It is known to whole pixels, as an edge may run along one: better than a slip, but
// not than distances that know a little more.
constexpr double kWeakForOutline = 0.02;
// The first brings the rims to the outline, the others tell how well they fit it.
constexpr int kOutlineSteps = 3;

Eigen::Matrix3d PriorOf(const Eigen::Vector3d& shares, const Eigen::Matrix3d& directions,
                        double weak_share) {
  const Eigen::Vector3d lacking = (weak_share - shares.array()).max(0);
  return directions * lacking.asDiagonal() * directions.transpose();
}

// `H` is that of the distances.
MotionPrior PriorFor(const Matrix6& H, const KnownDirections& known, const Pose& expected,
                     double weak_share) {
  MotionPrior prior;
  prior.expected = expected;
  const double weights = std::max(1.0, H.topLeftCorner<3, 3>().trace());
  prior.P.topLeftCorner<3, 3>() = weights * PriorOf(known.shift_shares, known.shifts, weak_share);
  prior.P.bottomRightCorner<3, 3>() = weights * PriorOf(known.turn_shares, known.turns, weak_share);
  return prior;
}

DistanceTerm TermOf(const SdfRegistration& task, const MotionFrame& frame,
                    const SdfTrackConfig& config, std::size_t stride) {
  return {*task.model, task.points, frame, task.voxel_m, task.camera, config, stride};
}

// As narrow as residuals of that deviation ask for.
double HuberFor(double deviation_m, double voxel_m, const SdfTrackConfig& config) {
  return std::min(
      config.huber_voxels * voxel_m,
      config.huber_deviations * std::max(deviation_m, kLeastDeviation_voxels * voxel_m));
}

// None where the distances know all shifts.
PointTerm* OutlineOf(const SdfRegistration& task, const KnownDirections& known) {
  const bool is_weak = known.shift_shares.minCoeff() < kWeakForOutline;
  return is_weak && task.outline ? task.outline() : nullptr;
}

// The distances and the other terms of a finer pass.
class AllTerms {
 public:
  AllTerms(const SdfRegistration& task, const MotionFrame& frame, const SdfTrackConfig& config,
           std::size_t stride)
      : task_(&task),
        frame_(&frame),
        config_(&config),
        distances_(TermOf(task, frame, config, stride)) {}

  void KeepAt(const Pose& T_LC) {
    distances_.KeepAt(T_LC);
    deviation_m_ = distances_.KeptDeviation_m();
    distances_.SetHuber(HuberFor(deviation_m_, task_->voxel_m, *config_));
    deviation_m_ = std::max(deviation_m_, kLeastDeviation_voxels * task_->voxel_m);
    for (const auto& term : task_->others) term->KeepAt(T_LC, deviation_m_);
  }
  NormalEquations Sums(const Pose& T_LC) const {
    NormalEquations sums = distances_.Sums(T_LC);
    if (task_->others.empty()) return sums;
    const NormalEquations more = OfOthers(T_LC);
    sums.H += more.H;
    sums.g += more.g;
    sums.cost += more.cost;
    return sums;
  }
  // What distances know and, up to the config's share, what the others know.
  KnownDirections KnownAt(const Pose& T_LC) const {
    const Matrix6 of_distances = distances_.Sums(T_LC).H;
    KnownDirections known = DirectionsOf(of_distances);
    const Vector6 trust = Trust(T_LC, known, of_distances);
    known.shift_shares += config_->weak_share * trust.head<3>();
    known.turn_shares += config_->weak_share * trust.tail<3>();
    return known;
  }
  // Along weak directions, from T_LC: what is expected and, as far as they know it, what the other
  // terms and the outline say.
  MotionPrior PriorAt(const Pose& T_LC) const {
    const Matrix6 of_distances = distances_.Sums(T_LC).H;
    const KnownDirections known = DirectionsOf(of_distances);
    PointTerm* outline = OutlineOf(*task_, known);
    if (task_->others.empty() && outline == nullptr) {
      return PriorFor(of_distances, known, task_->BiasedExpectation(), WeakShareNow());
    }
    const double weights = std::max(1.0, of_distances.topLeftCorner<3, 3>().trace());
    Matrix6 directions = Matrix6::Zero();
    directions.topLeftCorner<3, 3>() = known.shifts;
    directions.bottomRightCorner<3, 3>() = known.turns;
    Vector6 shares;
    shares << known.shift_shares, known.turn_shares;
    const Vector6 trust = Trust(T_LC, known, of_distances);
    const Vector6 say = weights * (kWeakOfDistances - shares.array()).max(0) * trust.array();
    const Vector6 said = directions.transpose() * SaidByOthers(T_LC, directions, say);
    Answer seen;
    if (outline != nullptr) seen = AnswerOf(*outline, T_LC, known);
    const Vector6 say_seen = weights * (kWeakForOutline - shares.array()).max(0) *
                             seen.trust.array() * (1 - trust.array());
    const Vector6 pull = weights * (WeakShareNow() - shares.array()).max(0) * (1 - trust.array()) *
                         (1 - seen.trust.array());
    const Vector6 expected =
        directions.transpose() * frame_->LengthsOf(task_->BiasedExpectation() * T_LC.inverse());
    const Vector6 all = say + say_seen + pull;
    Vector6 target = Vector6::Zero();
    for (int i = 0; i < 6; ++i) {
      if (!(all[i] > 0)) continue;
      target[i] = (say[i] * said[i] + say_seen[i] * seen.way[i] + pull[i] * expected[i]) / all[i];
    }
    return {directions * all.asDiagonal() * directions.transpose(),
            frame_->MotionOf(directions * target) * T_LC};
  }
  DistanceCounts Count(const Pose& T_LC) const { return distances_.Count(T_LC); }

 private:
  double WeakShareNow() const { return WeakShare(deviation_m_, task_->voxel_m, *config_); }
  NormalEquations OfOthers(const Pose& T_LC) const {
    NormalEquations sums;
    for (const auto& term : task_->others) {
      const NormalEquations more = term->Sums(T_LC, *frame_);
      sums.H += more.H;
      sums.g += more.g;
      sums.cost += more.cost;
    }
    return sums;
  }
  // Along the known directions, shifts first: by how much the outline would have the object moved,
  // and how well it knows that once it is there, 1 where to kKnownOtherwise_voxels. Of turns it
  // says nothing: where an object is round, they move no outline.
  struct Answer {
    Vector6 way = Vector6::Zero();
    Vector6 trust = Vector6::Zero();
  };
  Answer AnswerOf(PointTerm& outline, const Pose& T_LC, const KnownDirections& known) const {
    Eigen::Matrix3d weak = known.shifts;
    for (int i = 0; i < 3; ++i) {
      if (known.shift_shares[i] >= kWeakForOutline) weak.col(i).setZero();
    }
    Answer answer;
    for (int step = 0; step < kOutlineSteps; ++step) {
      Vector6 moved = Vector6::Zero();
      moved.head<3>() = weak * answer.way.head<3>();
      const Pose there = frame_->MotionOf(moved) * T_LC;
      outline.KeepAt(there, deviation_m_);
      const NormalEquations sums = outline.Sums(there, *frame_);
      const Eigen::Matrix3d H = weak.transpose() * sums.H.topLeftCorner<3, 3>() * weak;
      const Eigen::Matrix3d floor = (1e-9 + kNoShare * H.trace()) * Eigen::Matrix3d::Identity();
      const Eigen::Vector3d way = -(H + floor).ldlt().solve(weak.transpose() * sums.g.head<3>());
      if (!way.allFinite()) return {};
      answer.way.head<3>() += way;
      answer.trust.head<3>() = (H.diagonal() / KnownAtLeast()).cwiseMin(1);
    }
    return answer;
  }
  // The motion from T_LC by which their errors are least, along those directions (columns) in which
  // they have a say.
  Vector6 SaidByOthers(const Pose& T_LC, const Matrix6& directions, const Vector6& say) const {
    const NormalEquations sums = OfOthers(T_LC);
    Matrix6 chosen = directions;
    for (int i = 0; i < 6; ++i) {
      if (!(say[i] > 0)) chosen.col(i).setZero();
    }
    Matrix6 H = chosen.transpose() * sums.H * chosen;
    const double floor = 1e-9 + kNoShare * H.trace();
    H.diagonal().array() += floor;
    const Vector6 way = -H.ldlt().solve(chosen.transpose() * sums.g);
    return way.allFinite() ? Vector6(chosen * way) : Vector6(Vector6::Zero());
  }
  // How well the others know each direction, shifts first: 1 where they leave no more open than
  // kKnownOtherwise_voxels.
  Vector6 Trust(const Pose& T_LC, const KnownDirections& known, const Matrix6& of_distances) const {
    Matrix6 at_best = Matrix6::Zero();
    for (const auto& term : task_->others) at_best += term->Information(T_LC, *frame_);
    const AlongDirections along = Along(known, of_distances, at_best);
    Vector6 trust;
    trust << along.shifts, along.turns;
    return (trust / KnownAtLeast()).cwiseMin(1);
  }
  // Information of a direction that is known to kKnownOtherwise_voxels.
  double KnownAtLeast() const {
    const double open_m = kKnownOtherwise_voxels * task_->voxel_m;
    return deviation_m_ * deviation_m_ / (open_m * open_m);
  }

  const SdfRegistration* task_;
  const MotionFrame* frame_;
  const SdfTrackConfig* config_;
  DistanceTerm distances_;
  double deviation_m_ = 0;
};

// Passes of the coarse search from one seed: what is kept of the points holds near where it was
// kept.
constexpr int kCoarsePasses = 2;

// From every seed, with a share of the points: the pose of least cost, in the result.
void RegisterCoarsely(const SdfRegistration& task, const SdfTrackConfig& config,
                      LeastSquaresOptions options, SdfRegistrationResult& result) {
  options.settled_m *= 10;
  const std::size_t stride =
      std::max<std::size_t>(1, task.points.size() / static_cast<std::size_t>(config.coarse_points));
  DistanceTerm coarse = TermOf(task, result.frame, config, stride);
  const auto sums = [&](const Pose& T) { return coarse.Sums(T); };
  double least = std::numeric_limits<double>::infinity();
  const auto try_seed = [&](const Pose& seed) {
    Pose T_LC = seed;
    for (int pass = 0; pass < kCoarsePasses; ++pass) {
      coarse.KeepAt(T_LC);
      const Matrix6 H = coarse.Sums(T_LC).H;
      const double weak_share = WeakShare(coarse.KeptDeviation_m(), task.voxel_m, config);
      const MotionPrior prior = PriorFor(H, DirectionsOf(H), task.BiasedExpectation(), weak_share);
      const LeastSquaresResult found = MinimiseOverPose(sums, T_LC, result.frame, prior, options);
      result.iterations += found.iterations;
      T_LC = found.T;
    }
    coarse.KeepAt(T_LC);
    const double cost = coarse.Sums(T_LC).cost;
    if (!(cost < least)) return;
    least = cost;
    result.T_LC = T_LC;
  };
  if (!task.is_near) try_seed(task.T_LC_expected);
  for (const Pose& seed : task.T_LC_seeds) try_seed(seed);
}

// Of the fine search: with a share of the points, and then with all of them, or with all alone.
constexpr int kMiddlePasses = 2;
constexpr int kLastPasses = 1;
constexpr int kPassesOfAll = kMiddlePasses + kLastPasses;

LeastSquaresResult RunPasses(const SdfRegistration& task, const LeastSquaresOptions& options,
                             int passes, AllTerms& terms, SdfRegistrationResult& result) {
  MotionPrior prior;
  LeastSquaresResult found;
  for (int pass = 0; pass < passes; ++pass) {
    terms.KeepAt(result.T_LC);
    if (pass == 0 || !task.others.empty()) prior = terms.PriorAt(result.T_LC);
    found = MinimiseOverPose([&](const Pose& T) { return terms.Sums(T); }, result.T_LC,
                             result.frame, prior, options);
    result.iterations += found.iterations;
    result.T_LC = found.T;
  }
  return found;
}

LeastSquaresResult RegisterFinely(const SdfRegistration& task, const SdfTrackConfig& config,
                                  const LeastSquaresOptions& options, AllTerms& all,
                                  SdfRegistrationResult& result) {
  const std::size_t stride = task.points.size() / static_cast<std::size_t>(config.middle_points);
  if (stride < 2) return RunPasses(task, options, kPassesOfAll, all, result);
  AllTerms some(task, result.frame, config, stride);
  RunPasses(task, options, kMiddlePasses, some, result);
  return RunPasses(task, options, kLastPasses, all, result);
}

}  // namespace

double WeakShare(double deviation_m, double voxel_m, const SdfTrackConfig& config) {
  const double part = deviation_m / (kWeakDeviation_voxels * voxel_m);
  return config.weak_share * std::clamp(part, kLeastOfWeakShare, 1.0);
}

OtherPlace ComparePlace(const SdfRegistration& task, const Pose& T_LC,
                        const SdfRegistrationResult& found, const SdfTrackConfig& config,
                        bool may_seem_biased) {
  DistanceTerm term = TermOf(task, found.frame, config, 1);
  term.SetHuber(HuberFor(found.counts.deviation_m, task.voxel_m, config));
  for (const auto& of : task.others) {
    of->KeepAt(found.T_LC,
               std::max(found.counts.deviation_m, kLeastDeviation_voxels * task.voxel_m));
  }
  const auto cost_at = [&](const Pose& T, const Pose& T_of_others) {
    term.KeepAt(T);
    double cost = term.Sums(T).cost;
    for (const auto& of : task.others) cost += of->Sums(T_of_others, found.frame).cost;
    return cost;
  };
  const double cost_found = cost_at(found.T_LC, found.T_LC);
  const Pose seen = task.bias * T_LC;
  double cost = cost_at(T_LC, seen);
  if (may_seem_biased && !SameNumbers(seen, T_LC)) cost = std::min(cost, cost_at(seen, seen));
  OtherPlace other;
  other.cost_ratio = cost / cost_found;
  other.counts = term.Count(T_LC);
  return other;
}

SdfRegistrationResult RegisterToDistances(const SdfRegistration& task,
                                          const SdfTrackConfig& config) {
  SdfRegistrationResult result;
  result.T_LC = task.T_LC_expected;
  if (task.points.empty()) return result;
  result.frame = FrameOf(task);
  if (!result.frame.centre.allFinite() || !std::isfinite(result.frame.radius_m)) return result;
  const LeastSquaresOptions options{config.max_iterations, config.settled_voxels * task.voxel_m};
  RegisterCoarsely(task, config, options, result);
  AllTerms fine(task, result.frame, config, 1);
  const LeastSquaresResult found = RegisterFinely(task, config, options, fine, result);
  const bool is_settled =
      found.converged || found.last_step_m < kNearlySettled_voxels * task.voxel_m;
  // Where no point has a distance there is nothing to be at rest on.
  result.converged = is_settled && found.at.H.trace() > 0;
  result.counts = fine.Count(found.T);
  result.information = found.at.H;
  result.known = task.others.empty() ? DirectionsOf(found.at.H) : fine.KnownAt(found.T);
  const Matrix6 floor = (1e-9 + kNoShare * result.information.trace() / 6) * Matrix6::Identity();
  const Matrix6 information = result.information + floor;
  const double deviation_m = result.counts.deviation_m;
  result.weak_share = WeakShare(deviation_m, task.voxel_m, config);
  result.covariance = deviation_m * deviation_m * information.ldlt().solve(Matrix6::Identity());
  return result;
}

}  // namespace tsdfpp
