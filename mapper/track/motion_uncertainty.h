// How well the motion of a tracked object is known (docs/tracking.md, "What is known of a motion").
#pragma once

#include "mapper/track/motion_frame.h"

namespace tsdfpp {

// Where one segment was registered, and how well: six lengths about the segment's centroid, in the
// axes of the object's lattice.
struct PlaceUncertainty {
  MotionFrame frame_L;
  Matrix6 covariance_m2 = Matrix6::Zero();
};

// Of a motion, from the frame `since` on, in the world: six lengths about the centroid of the later
// segment, in the axes of the world.
struct MotionUncertainty {
  int since = 0;
  MotionFrame frame_W;
  Matrix6 covariance_m2 = Matrix6::Zero();
  // Directions of which the later segment's points know less than SdfTrackConfig::weak_share. Their
  // variances are as large as that leaves them: what the tracker expects counts as nothing.
  int free_directions = 0;
};

// The covariance of the same small motion's six lengths, in another frame with the same axes.
Matrix6 CovarianceIn(const MotionFrame& to, const MotionFrame& from, const Matrix6& covariance_m2);

// The covariance of `after` and of `before` together: errors of two segments of a camera with noise
// are independent. R_WL turns the lattice's axes into the world's, after the motion, and centre_W
// is the later segment's centroid. Of frames and free directions it knows nothing.
MotionUncertainty UncertaintyOfMotion(const PlaceUncertainty& before, const PlaceUncertainty& after,
                                      const Eigen::Matrix3d& R_WL, const Eigen::Vector3d& centre_W);

}  // namespace tsdfpp
