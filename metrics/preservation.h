// Truth to reconstruction: completion, occlusion preservation, retention, hole area
// (docs/sources.md, "Preservation and retention"). Nothing is aligned before: an object's samples
// go to the world by its true pose.
//
// Occlusion preservation OP(t, tau): of an object's samples that were seen before and are hidden at
// frame t, the share, by area, that the map has: surface of that object within tau that faces
// within 60 degrees of the sample's way. The map is looked at after the movers were removed.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "metrics/measured.h"
#include "metrics/normal_agreement.h"
#include "metrics/surface_samples.h"
#include "metrics/visibility.h"

namespace tsdfpp {

// A flag a sample: 1 where it belongs.
using Selection = std::vector<std::uint8_t>;

Selection SelectAll(const SampleSet& samples);
// The samples of one region of the model.
Selection SelectRegion(const SampleSet& samples, std::uint16_t region);

// Of the samples in `within`, those seen so far (docs/sources.md, "Seen and hidden").
Selection SelectSeen(const SeenTracker& tracker, const Selection& within);
// Of those, the ones whose status in the tracker's last frame is `status`: kVisible, or one cause
// of hiding.
Selection SelectSeenWith(const SeenTracker& tracker, SampleStatus status, const Selection& within);
// Of those, the ones hidden for whatever cause (docs/sources.md, "Seen and hidden"); kUnmeasured is
// not hidden.
Selection SelectHidden(const SeenTracker& tracker, const Selection& within);

// Matches the selected samples, placed by `T_WO`, against a surface in the world: the scene's faces
// of object o for the label-aware scores, all its faces for the label-agnostic ones. Entries of
// samples not selected are infinite. `limit_m`: the largest threshold that will be asked for.
SampleMatch MatchSamples(const SampleSet& samples_O, const Selection& selected, const Pose& T_WO,
                         const SurfaceIndex& surface_W, double limit_m,
                         double max_angle_rad = kMaxNormalAngle_rad);

// The samples with agreeing surface within `tau_m`.
Selection Reconstructed(const SampleMatch& match, double tau_m);

// Area of the selected samples, m^2.
double SelectedArea_m2(const SampleSet& samples, const Selection& selected);
// Share (0..1, by area) of the selected samples that are also in `those`; undefined, with the
// reason given, where nothing is selected.
Measured ShareOf(const SampleSet& samples, const Selection& selected, const Selection& those,
                 const std::string& why_empty);

// Weighted summary of distances in metres; undefined with one reason for all.
struct DistanceSummary {
  Measured mean_m;
  Measured rmse_m;
  Measured p95_m;  // the smallest distance that 95 % of the weight does not exceed
};
DistanceSummary SummariseDistances(std::span<const float> distances_m,
                                   std::span<const float> weights, const std::string& why_empty);

// Completion distances (truth to reconstruction) of the selected samples, by area, without regard
// to normals. Undefined where nothing is selected or the reconstruction is empty.
DistanceSummary CompletionDistances(const SampleSet& samples, const Selection& selected,
                                    const SampleMatch& match);

// F-score 2 P R / (P + R); 0 where both are 0, undefined where one is.
Measured FScore(const Measured& precision, const Measured& recall);

// Whether each sample was reconstructed when an evaluation last saw it.
class LastSeenStore {
 public:
  explicit LastSeenStore(std::size_t samples) : state_(samples, kNeverSeen) {}

  // At an evaluated frame: for the samples visible now, remembers whether they are reconstructed.
  void Update(const Selection& reconstructed, const Selection& visible_now);

  // Retention (docs/sources.md, "Preservation and retention"): of the hidden samples that some
  // evaluation saw, the area reconstructed now over the area that was reconstructed when they were
  // last seen. May exceed 1. Undefined where no evaluation saw any of them, or none was
  // reconstructed.
  Measured Retention(const SampleSet& samples, const Selection& hidden,
                     const Selection& reconstructed_now) const;

 private:
  enum State : std::uint8_t { kNeverSeen, kMissing, kPresent };
  std::vector<std::uint8_t> state_;
};

// The ways in which a seen sample can be hidden, and their names in reports.
inline constexpr std::array<SampleStatus, 3> kHidingCauses{
    SampleStatus::kBehindOther, SampleStatus::kBehindItself, SampleStatus::kOutside};
inline constexpr std::array<const char*, 3> kHidingCauseNames{"behind_other", "behind_itself",
                                                              "outside"};

// Of the samples that one cause hides: which forgetting a method suffers.
struct HiddenScores {
  double area_cm2 = 0;
  Measured preservation;  // OP
  Measured retention;
  Measured lost_area_cm2;  // (1 - OP) x area
  // OP that takes faces of any label: where it is above `preservation`, surface was kept under
  // another object's name. Undefined where no such selection was given.
  Measured any_label;
};

// All that one mesh and one frame say of one object or region.
struct PreservationScores {
  Measured completion;          // of the seen samples; also the recall at tau
  Measured visible_completion;  // of those visible now
  Measured preservation;        // OP(t, tau), over all hidden samples
  Measured preservation_behind_other;
  Measured preservation_behind_itself;
  Measured preservation_outside;
  Measured retention;               // over all hidden samples
  Measured retention_behind_other;  // over those behind another object
  Measured hole_area_cm2;           // (1 - OP) x area, behind another object
  double seen_area_cm2 = 0;
  double visible_area_cm2 = 0;
  double hidden_area_cm2 = 0;
  double behind_other_area_cm2 = 0;
  std::array<HiddenScores, 3> by_cause;  // in the order of kHidingCauses
};

// `within`: the samples to score, e.g. a region. `reconstructed`: from the mesh under examination.
// `any_label`: from all its faces, whatever their label; needed for the hidden samples only.
PreservationScores ScorePreservation(const SeenTracker& tracker, const Selection& within,
                                     const Selection& reconstructed, const LastSeenStore& last_seen,
                                     const Selection* any_label = nullptr);

}  // namespace tsdfpp
