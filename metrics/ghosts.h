// Ghosts: reconstructed surface where there is nothing (facts/metrics.md).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/types.h"
#include "metrics/measured.h"
#include "metrics/preservation.h"
#include "metrics/surface_samples.h"
#include "metrics/truth_surface.h"

namespace tsdfpp {

// What the depth images say of free space. Every frame is kept, shrunk to blocks of
// 4x4 pixels with their least and greatest depth (half a millimetre, rounded outwards; 130 kB a
// frame of 960x540). A point is judged by the *latest* frame that saw it, since objects move:
//  - all of its block deeper than the point by more than tau: the frame saw through it, free;
//  - all of its block within tau of the point: surface was there, not free;
//  - all of it nearer, mixed, invalid, or outside the image: that frame tells nothing, ask an
//    earlier one. A point that no frame tells of is not observed, so not free.
// Mixed blocks are depth edges and steep surfaces; asking an earlier frame there is the careful
// choice.
class FreeSpace {
 public:
  // Takes `depth` (floats, the intrinsics' size), `intrinsics` and `T_WC` of the frame; call once a
  // frame, in order.
  void Observe(const Frame& frame);

  // 1 where the point (world frame) was seen to be free.
  Selection ObservedFree(std::span<const Eigen::Vector3f> points_W, double tau_m) const;

 private:
  struct View {
    Intrinsics intrinsics;
    Pose T_CW;
    int columns = 0;
    // Per block, units of half a millimetre; least 0 where any pixel is invalid.
    std::vector<std::uint16_t> least;
    std::vector<std::uint16_t> greatest;
  };
  enum class Verdict { kFree, kSurface, kUnknown };
  static Verdict Ask(const View& view, const Eigen::Vector3d& p_W, double tau_m);

  std::vector<View> views_;
};

struct GhostScores {
  double area_m2 = 0;
  Measured share_of_mesh;  // 0..1
  Selection is_ghost;      // per sample, for pictures
};

// The part of a reconstruction (`samples_W`, by area) that is farther than `tau_m` from every
// surface in `current` (the objects not removed, at their current poses), outside their solids, and
// in free space: that which was observed, or, after a removal (`observed` is null), all of it.
GhostScores ScoreGhosts(const SampleSet& samples_W, std::span<const PlacedTruth> current,
                        double tau_m, const FreeSpace* observed);

}  // namespace tsdfpp
