#include "mapper/track/sdf_tracker.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "mapper/track/model_sight.h"
#include "mapper/volume/lattice_range.h"

namespace tsdfpp {
namespace {

// A seed nearer than this to another begins in the same valley.
constexpr double kSameSeed_voxels = 0.5;
// Motions that were not measured for longer than this are not extrapolated.
constexpr int kLongestExtrapolation_frames = 5;
// Depth that is farther from a model's surface is not the surface's.
constexpr double kOtherDepth_voxels = 2;
// What was at rest so many frames later was so for sure: noise hides the first of a motion.
constexpr std::int64_t kSurelyAtRest_frames = 10;
// Numbers of frames may be any.
constexpr std::int64_t kMostPassed = 1'000'000'000;

Eigen::Vector3d CentreOf(const std::vector<SegmentPoint>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const SegmentPoint& point : points) sum += point.p_C.cast<double>();
  return sum / static_cast<double>(points.size());
}

// The motion done `times` times.
Pose Repeated(const Pose& motion, int times) {
  Pose all = Pose::Identity();
  for (int i = 0; i < times; ++i) all = all * motion;
  return all;
}

// The motion without what it has along directions of which too little is known.
Pose KnownPart(const Pose& motion_L, const SdfRegistrationResult& found) {
  const double weak_share = found.weak_share;
  if (weak_share <= 0) return motion_L;
  const auto part = [&](const Eigen::Vector3d& shares, const Eigen::Matrix3d& directions,
                        const Eigen::Vector3d& x) -> Eigen::Vector3d {
    const Eigen::Vector3d trust = (shares.array() / weak_share).min(1);
    return directions * trust.asDiagonal() * directions.transpose() * x;
  };
  Vector6 x = found.frame.LengthsOf(motion_L);
  x.head<3>() = part(found.known.shift_shares, found.known.shifts, x.head<3>());
  x.tail<3>() = part(found.known.turn_shares, found.known.turns, x.tail<3>());
  return found.frame.MotionOf(x);
}

double TurnBetween_rad(const Pose& T_OC, const Pose& T_OC_other) {
  return Eigen::AngleAxisd(T_OC.linear().transpose() * T_OC_other.linear()).angle();
}

}  // namespace

Pose SdfTracker::Sight::T_LC_stay() const { return T_WL.inverse() * frame->T_WC; }

Pose SdfTracker::Sight::MotionTo(const Pose& T_LC) const { return T_LC_stay() * T_LC.inverse(); }

TrackedPoses SdfTracker::Track(const Frame& frame, const cv::Mat& labels,
                               const MapRepresentation& map, const ObjectPoses& before) {
  ++turn_;
  std::vector<Turn> turns;
  for (auto& [id, pixels] : PixelsByLabel(labels, config_.mask_erosion_px)) {
    turns.push_back({id, std::move(pixels), &memory_[id]});
  }
  // Each turn is its own object's alone.
  tbb::parallel_for(std::size_t{0}, turns.size(),
                    [&](std::size_t i) { Take(frame, labels, map, before, turns[i]); });
  TrackedPoses after{before};
  for (const Turn& turn : turns) {
    after.seen[turn.id] = turn.status;
    if (turn.motion) after.motions[turn.id] = *turn.motion;
    if (turn.status == TrackStatus::kBegun) after.T_WO.try_emplace(turn.id, Pose::Identity());
    if (turn.moved_to) after.T_WO[turn.id] = *turn.moved_to;
    if (turn.has_moved) after.moved.push_back(turn.id);
  }
  return after;
}

void SdfTracker::Take(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                      const ObjectPoses& before, Turn& turn) const {
  const double voxel_m = map.config().voxel_m;
  const auto points = SegmentPointsOf(frame, turn.pixels, voxel_m, config_);
  if (points.size() < static_cast<std::size_t>(config_.min_points)) return;
  Memory& memory = *turn.memory;
  Sight sight{&frame, &labels, turn.id, &points, CentreOf(points)};
  sight.voxel_m = voxel_m;
  std::optional<SegmentView> view;
  sight.view = [&]() -> const SegmentView& {
    if (!view) {
      view.emplace(frame, labels, turn.id, config_.max_step_voxels * voxel_m,
                   config_.colour_weight > 0);
    }
    return *view;
  };
  const auto known = before.find(turn.id);
  const std::optional<ObjectModel> model = models_(map, turn.id);
  // Its pixels may have waited until now, so that the map has nothing of it.
  if (known == before.end() || !model) {
    turn.status = TrackStatus::kBegun;
    // A model that is begun anew has a pose already.
    const Pose T_OC = known == before.end() ? frame.T_WC : known->second.inverse() * frame.T_WC;
    // It is the same object.
    Memory anew;
    anew.frame = frame.index;
    anew.centre_O = T_OC * sight.centre_C;
    anew.T_WO_begun = memory.T_WO_begun;
    anew.has_moved = memory.has_moved;
    anew.is_placed = memory.is_placed;
    memory = std::move(anew);
    Renew(memory.keyframe, config_.KeyframeTurn_rad(), sight, T_OC);
    Renew(memory.anchor, config_.AnchorTurn_rad(), sight, T_OC);
    return;
  }
  const auto registered = Register(sight, *model, known->second, memory);
  turn.has_moved = memory.has_moved;
  if (!registered) return;
  turn.status = TrackStatus::kTracked;
  turn.motion = registered->motion;
  if (SameNumbers(registered->T_WL, model->T_WL)) return;  // at rest
  turn.moved_to = MadeRigid(registered->T_WL * model->T_WL.inverse() * known->second);
}

void SdfTracker::Place(InstanceId id, int frame, PlacedModel model) {
  Memory& memory = memory_[id];
  memory.frame = frame - 1;
  memory.motion_L = Pose::Identity();
  memory.centre_O.reset();
  memory.leaning.reset();
  memory.place.reset();
  memory.T_WO_last.clear();
  if (model == PlacedModel::kOther) {
    memory.keyframe.reset();
    memory.anchor.reset();
  }
  memory.is_placed = true;
}

std::optional<SdfTracker::Registered> SdfTracker::Register(Sight sight, const ObjectModel& model,
                                                           const Pose& T_WO, Memory& memory) const {
  const Frame& frame = *sight.frame;
  const double voxel_m = sight.voxel_m;
  const SurfaceReader reader(*model.grid, voxel_m);
  sight.grid = model.grid;
  sight.model = &reader;
  sight.T_WL = model.T_WL;
  sight.T_LO = model.T_WL.inverse() * T_WO;
  // An object from a map's file has no memory yet.
  if (memory.centre_O) {
    const std::int64_t passed = std::int64_t{frame.index} - memory.frame;
    sight.passed = static_cast<int>(std::clamp<std::int64_t>(passed, 1, kMostPassed));
  }

  const std::optional<Calibration> near = Calibrate(sight, memory.keyframe);
  const std::optional<Calibration> far = Calibrate(sight, memory.anchor);
  SdfRegistration task = TaskOf(sight, memory);
  if (near) task.bias = near->correction_L.inverse();
  ViewTermParts parts = PartsOf(sight, memory, task.bias);
  if (config_.colour_weight > 0) parts.view = &sight.view();
  const auto others = ViewTermsOf(parts, config_);
  task.others = others;
  std::optional<std::unique_ptr<PointTerm>> outline;
  if (config_.outline_weight > 0) {
    task.outline = [&] {
      if (!outline) {
        parts.view = &sight.view();
        outline = OutlineTermOf(parts, config_);
      }
      return outline->get();
    };
  }
  SdfRegistrationResult found = RegisterToDistances(task, config_);
  const SdfRegistrationResult nearest = found;
  if (found.converged && near) {
    found.T_LC = (far ? Joined(*near, *far, found) : near->correction_L) * found.T_LC;
  }
  const Rest rest = StayAtRest(sight, task, nearest, memory, found);
  if (!rest.is_kept && !found.converged) return std::nullopt;
  // What fails does not begin to wait.
  if (!PassesGates(sight, found)) return std::nullopt;
  if (!rest.is_kept && IsHardlySeen(sight, found)) return std::nullopt;
  if (Waits(sight, rest, memory, found) || !PassesGates(sight, found)) return std::nullopt;
  const MotionUncertainty motion = Uncertainty(sight, found, memory);
  Remember(sight, found, rest, memory);

  const Pose motion_L = sight.MotionTo(found.T_LC);
  if (found.frame.LongestWay_m(motion_L) <= config_.rest_voxels * voxel_m) {
    return Registered{model.T_WL, motion};
  }
  return Registered{MadeRigid(frame.T_WC * found.T_LC.inverse()), motion};
}

SdfRegistration SdfTracker::TaskOf(const Sight& sight, const Memory& memory) const {
  SdfRegistration task{sight.model, *sight.points, sight.voxel_m, sight.frame->intrinsics};
  const int times = std::min(sight.passed, kLongestExtrapolation_frames);
  const Pose T_LC_stay = sight.T_LC_stay();
  task.T_LC_expected = Repeated(memory.motion_L, times).inverse() * T_LC_stay;
  const Eigen::Vector3d expected_L = task.T_LC_expected * sight.centre_C;
  const auto add_seed = [&](const Pose& seed) {
    if ((seed * sight.centre_C - expected_L).norm() > kSameSeed_voxels * sight.voxel_m) {
      task.T_LC_seeds.push_back(seed);
    }
  };
  add_seed(T_LC_stay);
  // As if the same part of it were in sight.
  if (memory.centre_O) {
    add_seed(Eigen::Translation3d(sight.T_LO * *memory.centre_O - expected_L) * task.T_LC_expected);
  }
  return task;
}

std::optional<Calibration> SdfTracker::Calibrate(const Sight& sight,
                                                 const std::optional<Keyframe>& keyframe) const {
  if (!keyframe) return std::nullopt;
  SdfRegistration task{sight.model, keyframe->points, sight.voxel_m, keyframe->camera};
  task.T_LC_expected = sight.T_LO * keyframe->T_OC;
  task.is_near = true;
  const SdfRegistrationResult apparent = RegisterToDistances(task, config_);
  if (!apparent.converged) return std::nullopt;
  return Calibration{task.T_LC_expected * apparent.T_LC.inverse(), apparent.known};
}

ViewTermParts SdfTracker::PartsOf(const Sight& sight, const Memory& memory,
                                  const Pose& bias) const {
  ViewTermParts parts{sight.frame};
  if (memory.keyframe && config_.ComparesViews()) {
    parts.key = &memory.keyframe->view;
    parts.T_LC_key = bias * sight.T_LO * memory.keyframe->T_OC;
  }
  parts.model = sight.grid;
  parts.reader = sight.model;
  parts.voxel_m = sight.voxel_m;
  return parts;
}

bool SdfTracker::PassesGates(const Sight& sight, const SdfRegistrationResult& found) const {
  const Vector6 way = found.frame.LengthsOf(sight.MotionTo(found.T_LC));
  if (!way.allFinite()) return false;
  const double turn_rad = way.tail<3>().norm() / found.frame.radius_m;
  const DistanceCounts& counts = found.counts;
  return way.head<3>().norm() <= config_.max_translation_voxels * sight.voxel_m * sight.passed &&
         turn_rad <= config_.max_rotation_rad * sight.passed &&
         counts.observed >= config_.min_observed_share * counts.points &&
         counts.inliers >= config_.min_inlier_share * counts.observed &&
         counts.inliers >= config_.min_points;
}

bool SdfTracker::IsHardlySeen(const Sight& sight, const SdfRegistrationResult& found) const {
  const Eigen::Matrix3d shifts = found.covariance.topLeftCorner<3, 3>();
  const double variance_m2 =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(shifts, Eigen::EigenvaluesOnly)
          .eigenvalues()[2];
  const double most_m = config_.max_hidden_deviation_voxels * sight.voxel_m;
  if (config_.min_shown_share <= 0 || variance_m2 <= most_m * most_m) return false;
  const Pose T_WL = sight.frame->T_WC * found.T_LC.inverse();
  const FacingVoxels facing = LookAtFacing(*sight.frame, *sight.labels, sight.id, *sight.grid, T_WL,
                                           sight.voxel_m, kOtherDepth_voxels * sight.voxel_m);
  return facing.ShownShare() < config_.min_shown_share;
}

MotionUncertainty SdfTracker::Uncertainty(const Sight& sight, const SdfRegistrationResult& found,
                                          Memory& memory) const {
  PlaceUncertainty here{found.frame, found.covariance};
  here.frame_L.centre = found.T_LC * sight.centre_C;
  // Of the segment that the model began with no place is known but that it is as noisy.
  const PlaceUncertainty before = memory.place.value_or(here);
  const Eigen::Matrix3d R_WL = (sight.frame->T_WC * found.T_LC.inverse()).linear();
  MotionUncertainty motion =
      UncertaintyOfMotion(before, here, R_WL, sight.frame->T_WC * sight.centre_C);
  motion.since = sight.frame->index - sight.passed;
  motion.free_directions = found.known.CountBelow(config_.weak_share);
  memory.place = here;
  return motion;
}

void SdfTracker::Remember(const Sight& sight, const SdfRegistrationResult& found, const Rest& rest,
                          Memory& memory) const {
  const Pose T_OC = sight.T_LO.inverse() * found.T_LC;
  memory.was_at_rest = memory.was_at_rest && rest.is_kept && !rest.is_back;
  if (config_.rest_turn_rad > 0) RenewAtRest(sight, T_OC, memory);
  Renew(memory.keyframe, config_.KeyframeTurn_rad(), sight, T_OC);
  Renew(memory.anchor, config_.AnchorTurn_rad(), sight, T_OC);
  if (sight.passed != 1) memory.T_WO_last.clear();
  memory.T_WO_last.push_back(sight.frame->T_WC * T_OC.inverse());
  if (memory.T_WO_last.size() > static_cast<std::size_t>(config_.rest_frames)) {
    memory.T_WO_last.pop_front();
  }
  memory.frame = sight.frame->index;
  memory.centre_O = T_OC * sight.centre_C;
  const Pose motion_L = sight.MotionTo(found.T_LC);
  memory.motion_L = rest.is_back ? Pose::Identity() : KnownPart(motion_L, found);
  if (sight.passed > 1) {
    memory.motion_L = found.frame.MotionOf(found.frame.LengthsOf(memory.motion_L) / sight.passed);
  }
}

void SdfTracker::Renew(std::optional<Keyframe>& keyframe, double turn_rad, const Sight& sight,
                       const Pose& T_OC) const {
  if (turn_rad <= 0) return;
  if (keyframe) {
    if (TurnBetween_rad(keyframe->T_OC, T_OC) <= turn_rad) return;
  }
  keyframe = KeyframeOf(sight, T_OC);
}

void SdfTracker::RenewAtRest(const Sight& sight, const Pose& T_OC, Memory& memory) const {
  const std::int64_t frame = sight.frame->index;
  if (!memory.was_at_rest || !memory.keyframe) {
    memory.waiting.reset();
    return;
  }
  if (memory.waiting && frame - memory.waiting_since < kSurelyAtRest_frames) return;
  if (memory.waiting) {
    const double waiting_rad = TurnBetween_rad(memory.waiting->T_OC, T_OC);
    for (auto* kept : {&memory.keyframe, &memory.anchor}) {
      if (!*kept) continue;
      const double kept_rad = TurnBetween_rad((*kept)->T_OC, T_OC);
      if (kept_rad > config_.rest_turn_rad && waiting_rad < kept_rad) *kept = memory.waiting;
    }
  }
  memory.waiting = KeyframeOf(sight, T_OC);
  memory.waiting_since = frame;
}

SdfTracker::Keyframe SdfTracker::KeyframeOf(const Sight& sight, const Pose& T_OC) const {
  const std::vector<SegmentPoint>& points = *sight.points;
  const Intrinsics& camera = sight.frame->intrinsics;
  const std::size_t count =
      std::min(points.size(), static_cast<std::size_t>(config_.keyframe_points));
  Keyframe keyframe{{}, T_OC, camera, {}};
  if (config_.ComparesViews()) keyframe.view = KeyViewOf(sight.view(), points, camera, config_);
  keyframe.points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    keyframe.points.push_back(points[i * points.size() / count]);
  }
  return keyframe;
}

}  // namespace tsdfpp
