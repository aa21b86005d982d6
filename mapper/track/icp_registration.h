// Tracks an object between two frames by registering its segment to its mesh (paper III-D): PCL's
// ICP, point-to-plane, minimised by Levenberg-Marquardt.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "core/toml_reader.h"
#include "core/types.h"

namespace tsdfpp {

struct IcpConfig {
  double correspondence_voxels = 3;    // a point farther than this from every vertex has no match
  int max_iterations = 20;             // ICP that has not settled by then has failed
  double settled_voxels = 0.02;        // settled: an iteration moves no point by more than this
  int mask_erosion_px = 2;             // taken off the segment's outline, where depth is mixed
  int max_points = 5000;               // of a segment; more are thinned evenly
  int min_points = 50;                 // of a segment, and of its matches
  double min_inlier_share = 0.5;       // of the segment's points that have a match at the end
  double max_translation_voxels = 10;  // of the segment's centroid between two frames
  double max_rotation_rad = 0.35;      // between two frames

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Reads one table strictly; `where` names the file in errors.
  static Expected<IcpConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const IcpConfig&) const = default;
};

struct TrackResult {
  // The object's motion in the world between two frames: T_WO(new) = T_O * T_WO(old). The identity
  // where tracking failed.
  Pose T_O = Pose::Identity();
  bool converged = false;
  int iterations = 0;       // of ICP; 0 where it was not started
  int correspondences = 0;  // segment points with a match at the end
  double rmse_m = 0;        // of the point-to-plane distances of those matches
};

// The points of a segment in the world, metres, from those of its pixels (PixelsByLabel() in
// mapper/track/segment_points.h with `mask_erosion_px`) that have valid depth. Of more than
// `max_points`, those at even steps in row order.
std::vector<Eigen::Vector3d> SegmentPoints(const Frame& frame, const std::vector<int>& pixels,
                                           const IcpConfig& config);

// Minimises the paper's eq. (1) over transformations that take the segment's points `segment_W`
// (new frame) to the nearest vertices of the object's mesh `model_W` (at its old pose) along their
// normals (of the faces around them, weighted by area). The paper calls that transformation T_O;
// the object moved by its *inverse*, which is the T_O returned here. `voxel_m` is the unit of the
// config's lengths. Failed (identity, not converged) where points or matches are too few, ICP has
// not settled, or the motion is beyond the config's limits. Deterministic, one thread; `config`
// must be valid.
TrackResult TrackObject(const std::vector<Eigen::Vector3d>& segment_W, const TriangleMesh& model_W,
                        double voxel_m, const IcpConfig& config);

}  // namespace tsdfpp
