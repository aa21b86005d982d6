// Where an object is after a frame: its segment registered to its signed distances, by one
// Levenberg-Marquardt search over six numbers and without matching points (docs/tracking.md).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "mapper/track/distance_term.h"
#include "mapper/track/known_directions.h"
#include "mapper/track/point_term.h"

namespace tsdfpp {

// A segment of one frame and what to register it to. T_LC takes the camera's frame to the object's
// lattice, in which the search is done.
struct SdfRegistration {
  const SurfaceReader* model = nullptr;
  std::span<const SegmentPoint> points{};
  double voxel_m = 0;
  Intrinsics camera{};
  // Where the motion that the object is expected to go on with would bring it.
  Pose T_LC_expected = Pose::Identity();
  // Further places to begin at.
  std::vector<Pose> T_LC_seeds{};
  // The expected place is as good as right: no coarse pass.
  bool is_near = false;
  // Terms beside the distances, of the finer passes.
  std::span<const std::unique_ptr<PointTerm>> others{};
  // Gives the term of the outline, or null; asked where the distances leave a shift weak. None
  // where it is empty.
  std::function<PointTerm*()> outline{};
  // Where the model makes what is at T_LC seem to be: bias * T_LC. The other terms and the outline
  // are made for what seems.
  Pose bias = Pose::Identity();
  // What is expected along directions that it alone knows. Without the bias it would move an object
  // by that, frame by frame, once the bias is taken off what was found.
  Pose BiasedExpectation() const { return bias * T_LC_expected; }
};

struct SdfRegistrationResult {
  Pose T_LC = Pose::Identity();  // where the segment seems to be
  // The last pass settled, or its last step moved no point by more than a tenth of a voxel.
  bool converged = false;
  int iterations = 0;  // of all passes
  DistanceCounts counts;
  // What the terms know, without the expectation: over the six lengths of `frame`, in points.
  MotionFrame frame;
  Matrix6 information = Matrix6::Zero();
  // Its weak and strong directions, and the share below which one is weak.
  KnownDirections known;
  double weak_share = 0;
  // Of the six lengths, square metres, where the points' errors are independent of each other and
  // of the deviation in `counts`, as a camera's noise is. The expectation counts as nothing: along
  // a direction that the points do not know the variance is large.
  Matrix6 covariance = Matrix6::Zero();
};

// Of points with this robust deviation: config.weak_share, or less. Where little is known, most of
// that is what is wrong with the model, by about as much as points differ from it.
double WeakShare(double deviation_m, double voxel_m, const SdfTrackConfig& config);

// Registers to where the segment seems to be, in two passes: few points and a wide Huber function
// from every seed, then all points, and the other terms, from where the cost was least. Along
// directions of which less than WeakShare() of the points' information speaks, a prior pulls
// towards where what is at the expected pose would seem to be, up to that share. Along directions
// of which the distances know less than a fifth it pulls, up to that, to where the other terms
// would have the object, as far as they know the direction. Along shifts of which they know less
// than a fiftieth it pulls, up to that, to where the outline would have it, as far as that knows
// them (docs/tracking.md, "Terms of the image"). Points that are not finite, and a model or segment
// without anything in it, give converged = false. Deterministic for any number of threads; `config`
// must be valid.
SdfRegistrationResult RegisterToDistances(const SdfRegistration& task,
                                          const SdfTrackConfig& config);

// What the points say of a place T_LC, and how many times as much against it as against the one
// found: the ratio of the two costs, robust squared distances, with the Huber width of the latter's
// deviation. An object at T_LC seems to be at bias * T_LC where the bias is right, and at T_LC
// where it is not: with `may_seem_biased` the place costs what the cheaper of both does, else what
// the latter does.
struct OtherPlace {
  DistanceCounts counts;
  double cost_ratio = 1;
};
OtherPlace ComparePlace(const SdfRegistration& task, const Pose& T_LC,
                        const SdfRegistrationResult& found, const SdfTrackConfig& config,
                        bool may_seem_biased);

}  // namespace tsdfpp
