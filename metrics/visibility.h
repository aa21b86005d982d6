// Which samples of an object's true surface the camera has seen, sees now, or cannot see and why.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "metrics/surface_samples.h"

namespace tsdfpp {

// What one frame says of one sample.
enum class SampleStatus : std::uint8_t {
  kVisible,       // observed
  kBehindOther,   // another object is in front at the sample's pixel
  kBehindItself,  // it faces away, or its own object is in front
  kOutside,       // outside the image, or behind the camera
  // In view and behind nothing, yet not measured: grazing incidence, a silhouette that falls
  // between pixels, or no valid depth. Nothing hides such a sample, so it is neither visible nor
  // hidden.
  kUnmeasured,
};

struct VisibilityConfig {
  double margin_m = 0.002;        // between the sample's and the image's depth
  double max_incidence_deg = 75;  // between the normal and the direction to the camera
  int min_frames = 3;             // observations until a sample is "seen"
};

// Follows the samples of one object through a sequence (docs/sources.md, "Seen and hidden").
//
// The depth test: the sample is observed where its nearest pixel shows the object's id, its
// incidence is under the limit, and that pixel's depth (or that of one of the other three pixels
// around its projection, which matters at edges) agrees within the margin with the depth at which
// *that pixel's* ray meets the sample's tangent plane. Comparing depths of two different rays would
// refuse sound samples: half a pixel at 75 deg is 5 mm at 1.5 m and f = 560 px.
//
// Where something else is first on the ray, the cause is the id shown. A sample that faces away is
// behind itself, even where another object is in front of both: taking that away would not show it.
class SeenTracker {
 public:
  // Keeps a copy of the samples, which are in the object's frame.
  SeenTracker(SampleSet samples_O, InstanceId id, VisibilityConfig config = {});

  // Takes in one frame: `depth`, `mask`, `intrinsics` and `T_WC` of `frame`, the object's true pose
  // `T_WO`. Linear in the samples, in parallel; the result does not depend on the threads.
  // Errors: kData where depth or mask do not have the intrinsics' size or their type.
  Expected<void> Observe(const Frame& frame, const Pose& T_WO);

  const SampleSet& samples_O() const { return samples_O_; }
  InstanceId id() const { return id_; }
  // By the last frame; kOutside before the first.
  const std::vector<SampleStatus>& status() const { return status_; }
  // Frames in which each sample was observed (saturates at 65535).
  const std::vector<std::uint16_t>& observations() const { return observations_; }
  bool Seen(std::size_t sample) const { return observations_[sample] >= config_.min_frames; }

 private:
  SampleSet samples_O_;
  InstanceId id_;
  VisibilityConfig config_;
  std::vector<SampleStatus> status_;
  std::vector<std::uint16_t> observations_;
};

}  // namespace tsdfpp
