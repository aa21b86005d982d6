// What the tracker says of objects at rest: that one stays there, rests again, or waits for more of
// a motion that begins.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "mapper/track/sdf_tracker.h"
#include "mapper/track/trend.h"

namespace tsdfpp {
namespace {

// An object that moves less from frame to frame may be at rest.
constexpr double kSlow_voxels = 0.1;
// Where two frames find an object at rest beside its place, the later one farther than the first by
// kSlow_voxels and by this factor, and in the same direction by this cosine, noise is a worse
// reason than a motion that begins, and this share of the evidence is enough.
constexpr double kFartherBy = 1.3;
constexpr double kSameWay = 0.7;
constexpr double kShareGoingOn = 0.4;
// What moves rests again where less than this share of the evidence is against it, and no farther
// than this from there: a flat side slides along itself, and nothing is against its old place. A
// turn of which nothing is known is left out: noise makes it.
constexpr double kShareAgain = 0.5;
constexpr double kNearAgain_voxels = 1;
// Whose places come less far than this from the first to the last goes nowhere.
constexpr double kCreep_voxels = 0.05;
// What seems to move for longer, and has not come as far as an object that moves, is something
// else: its model is wrong there.
constexpr int kLongestWait_frames = 20;

bool GoesOn(const Vector6& before, const Vector6& now, double voxel_m) {
  return now.norm() - before.norm() > kSlow_voxels * voxel_m &&
         now.norm() > kFartherBy * before.norm() &&
         now.dot(before) > kSameWay * now.norm() * before.norm();
}

// How many times as much evidence is asked of few points, which can be off together.
double FewPointsFactor(int points, const SdfTrackConfig& config) {
  return std::max(1.0, double(config.motion_points) / std::max(points, 1));
}

// Against the place: (what it costs there / at the nearest place - 1) sqrt(n), n the number of
// observed points.
double EvidenceAgainst(const OtherPlace& there, const SdfRegistrationResult& nearest) {
  return (there.cost_ratio - 1) * std::sqrt(static_cast<double>(nearest.counts.observed));
}

// How far it is from the place found to T_LC, as MotionFrame::LongestWay_m, without turns along
// weak directions.
double WayOfKnownTurns_m(const SdfRegistrationResult& found, const Pose& T_LC,
                         const SdfTrackConfig& config) {
  const Vector6 way = found.frame.LengthsOf(T_LC * found.T_LC.inverse());
  Eigen::Vector3d turn = found.known.turns.transpose() * way.tail<3>();
  if (config.weak_share > 0) {
    turn.array() *= (found.known.turn_shares.array() / config.weak_share).min(1);
  }
  return way.head<3>().norm() + 2 * turn.norm();
}

}  // namespace

SdfTracker::Rest SdfTracker::StayAtRest(const Sight& sight, const SdfRegistration& task,
                                        const SdfRegistrationResult& nearest, Memory& memory,
                                        SdfRegistrationResult& found) const {
  const std::optional<Vector6> leant = std::exchange(memory.leaning, std::nullopt);
  Rest rest;
  if ((config_.rest_evidence <= 0 && !waits_) || nearest.counts.observed == 0) return rest;
  if (GoesOneWay(sight, found, memory)) return rest;
  if (found.frame.LongestWay_m(memory.motion_L) > kSlow_voxels * sight.voxel_m) {
    rest.is_kept = rest.is_back = RestsAgain(sight, task, nearest, memory, found);
    return rest;
  }
  rest.T_LC = sight.T_LC_stay();
  const OtherPlace there =
      ComparePlace(task, rest.T_LC, nearest, config_, !waits_ || memory.has_moved);
  rest.counts = there.counts;
  const Vector6 leaning = found.frame.LengthsOf(sight.MotionTo(found.T_LC));
  rest.evidence = EvidenceAgainst(there, nearest);
  const bool goes_on = leant && sight.passed == 1 && GoesOn(*leant, leaning, sight.voxel_m);
  rest.is_kept = rest.evidence < config_.rest_evidence * (goes_on ? kShareGoingOn : 1);
  if (!rest.is_kept) return rest;
  memory.leaning = leaning;
  found.T_LC = rest.T_LC;
  found.counts = rest.counts;
  return rest;
}

bool SdfTracker::GoesOneWay(const Sight& sight, const SdfRegistrationResult& found,
                            const Memory& memory) const {
  if (config_.rest_trend <= 0 || (waits_ && !memory.has_moved)) return false;
  const auto frames = static_cast<std::size_t>(config_.rest_frames);
  if (sight.passed != 1 || memory.T_WO_last.size() < frames) return false;
  std::vector<Vector6> places;  // seen from the one found
  for (const Pose& T_WO : memory.T_WO_last) {
    const Pose T_LC = sight.T_LO * T_WO.inverse() * sight.frame->T_WC;
    places.push_back(found.frame.LengthsOf(T_LC * found.T_LC.inverse()));
  }
  places.push_back(Vector6::Zero());
  return TrendOf(places, found.known, config_.weak_share, kCreep_voxels * sight.voxel_m) >
         config_.rest_trend;
}

bool SdfTracker::RestsAgain(const Sight& sight, const SdfRegistration& task,
                            const SdfRegistrationResult& nearest, const Memory& memory,
                            SdfRegistrationResult& found) const {
  const auto frames = static_cast<std::size_t>(config_.rest_frames);
  if (frames == 0 || config_.rest_evidence <= 0 || (waits_ && !memory.has_moved)) return false;
  if (sight.passed != 1 || memory.T_WO_last.size() < frames) return false;
  const Pose T_LC = sight.T_LO * memory.T_WO_last.front().inverse() * sight.frame->T_WC;
  if (WayOfKnownTurns_m(found, T_LC, config_) > kNearAgain_voxels * sight.voxel_m) return false;
  const OtherPlace there = ComparePlace(task, T_LC, nearest, config_, true);
  if (EvidenceAgainst(there, nearest) >= kShareAgain * config_.rest_evidence) return false;
  found.T_LC = T_LC;
  found.counts = there.counts;
  return true;
}

bool SdfTracker::Waits(const Sight& sight, const Rest& rest, Memory& memory,
                       SdfRegistrationResult& found) const {
  if (!waits_ || memory.has_moved) return false;
  if (!memory.T_WO_begun) memory.T_WO_begun = sight.T_WL * sight.T_LO;
  const auto away_voxels = [&](const Pose& T_LC) {
    const Pose T_WO = sight.frame->T_WC * T_LC.inverse() * sight.T_LO;
    const Pose motion_W = T_WO * memory.T_WO_begun->inverse();
    const Eigen::Vector3d begun_W = motion_W.inverse() * (sight.frame->T_WC * sight.centre_C);
    return MotionFrame{begun_W, found.frame.radius_m}.LongestWay_m(motion_W) / sight.voxel_m;
  };
  // It was lost, and was found elsewhere.
  if (std::exchange(memory.is_placed, false) &&
      away_voxels(sight.T_LC_stay()) >= config_.motion_voxels) {
    memory.has_moved = true;
    return false;
  }
  if (memory.turn_before != turn_ - 1) {
    memory.turns_away = memory.turns_waited = 0;
    memory.evidence_away = 0;
  }
  memory.turn_before = turn_;
  const bool is_away = !rest.is_kept && away_voxels(found.T_LC) >= config_.motion_voxels;
  const double evidence = rest.evidence / FewPointsFactor(found.counts.observed, config_);
  const bool is_sure = is_away && evidence >= config_.motion_evidence;
  memory.turns_away = is_sure ? memory.turns_away + 1 : 0;
  memory.evidence_away = is_sure ? memory.evidence_away + evidence : 0;
  memory.has_moved = memory.turns_away >= config_.motion_frames &&
                     memory.evidence_away >= config_.motion_evidence_sum;
  const bool is_beside =
      found.frame.LongestWay_m(sight.MotionTo(found.T_LC)) > kSlow_voxels * sight.voxel_m;
  if (memory.has_moved || rest.is_kept || !is_beside) {
    memory.turns_waited = 0;
  } else if (++memory.turns_waited <= kLongestWait_frames || is_away) {
    return true;
  }
  if (!memory.has_moved) {
    found.T_LC = rest.T_LC;
    found.counts = rest.counts;
  }
  return false;
}

}  // namespace tsdfpp
