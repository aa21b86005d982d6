// Ghosts: reconstructed surface where there is nothing (docs/sources.md, "Ghosts").
#pragma once

#include <array>
#include <cstdint>
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

// How ghosts are sampled: only what may be one, so that the samples are dense where they matter.
struct GhostSampling {
  double per_cm2 = 16;
  std::size_t max_samples = 100'000;  // the density falls until this holds
  std::uint64_t seed = 1;
};

// What is known of the place where there should be no surface.
enum class GhostSpace : std::uint8_t {
  kSeenFree,  // FreeSpace saw through it
  // In a removed object's solid or within tau of its surface, at its last pose: the object's until
  // the removal, free since.
  kVacated,
  // The rest: free in truth, but nobody has seen it to be, so a map cannot know. Behind surfaces,
  // outside all images, and where something moved away unseen.
  kUnseen,
};
inline constexpr std::array<const char*, 3> kGhostSpaceNames{"seen free", "vacated", "unseen"};

// An area and how far off sampling may have put it. The standard error is that of the samples
// alone: it says whether two figures of one scene differ, not what another scene would give.
struct AreaEstimate {
  double area_m2 = 0;
  double standard_error_m2 = 0;
};

struct GhostScores {
  AreaEstimate ghosts;                // kSeenFree and kVacated: space that is known to be free
  std::array<AreaEstimate, 3> space;  // by GhostSpace
  Measured share_of_mesh;             // of `ghosts`, 0..1
  // For pictures and figures, the samples of all three; `triangle` is the mesh's.
  SampleSet samples;
  std::vector<GhostSpace> sample_space;
};

// The part of a reconstruction that is farther than `tau_m` from every surface in `current` (the
// objects not removed, at their current poses) and outside their solids, by what is known of the
// space there. `removed` are the objects that were removed; none before a removal.
//
// Two steps. Triangles (cut while they are longer than tau and undecided) are left out, without an
// error, where they are near the truth all over: where their centroid's distance and their radius
// come to tau at most, or all three corners are within tau of one true triangle. The rest is
// sampled: its
// area is cut into stretches of equal area as by SampleMesh, each with two independent samples, a
// and b in {0, 1} with half of the stretch's area s each. The estimate is the sum of s (a + b) / 2,
// its standard error the root of the sum of s^2 (a - b)^2 / 4, whose square is unbiased (two units
// a stratum: W. G. Cochran, Sampling Techniques, 3rd ed., section 5A.12, without correction for a
// finite population).
GhostScores ScoreGhosts(const TriangleMesh& mesh_W, std::span<const PlacedTruth> current,
                        std::span<const PlacedTruth> removed, double tau_m,
                        const FreeSpace& observed, const GhostSampling& sampling = {});

}  // namespace tsdfpp
