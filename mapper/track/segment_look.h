// A segment as one frame shows it: its points, its looks, and whether all of it is in sight.
#pragma once

#include <vector>

#include "mapper/track/appearance.h"
#include "mapper/track/sdf_track_config.h"
#include "mapper/track/segment_points.h"

namespace tsdfpp {

// Pixels of one segment, by rows (PixelsByLabel()): row times columns plus column.
using LoosePixels = std::vector<int>;

struct SegmentLook {
  std::vector<SegmentPoint> points;
  Appearance appearance;    // empty where it is not large
  bool is_large = false;    // enough to be tracked
  bool is_at_edge = false;  // of the picture, beyond which the rest of it may be
  bool is_covered = false;  // much of its outline is beside something nearer
  bool IsWhole() const { return is_large && !is_at_edge && !is_covered; }
};

// Where only few of a large rectangle's pixels are the segment's, it is no thing, and is said to be
// at the edge. `config` must be valid.
SegmentLook LookAtSegment(const Frame& frame, const LoosePixels& pixels, double voxel_m,
                          const SdfTrackConfig& config);

}  // namespace tsdfpp
