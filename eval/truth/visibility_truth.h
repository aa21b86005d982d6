// Ground truth on what can be seen: per object and frame how much of it is visible, where in the
// image it is, and how many samples of its surface are seen or hidden, and by whom.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "metrics/surface_samples.h"
#include "metrics/visibility.h"

namespace tsdfpp {

// Pixels u to u + width - 1; all zero where there is none.
struct PixelBox {
  int u = 0;
  int v = 0;
  int width = 0;
  int height = 0;
  bool operator==(const PixelBox&) const = default;
};

struct ObjectVisibility {
  int frame = 0;
  InstanceId id = kBackground;
  std::int64_t visible_px = 0;  // of the mask
  PixelBox visible_box;
  // As BOP defines them (bop_toolkit, calc_gt_info): the silhouette of the object rendered alone,
  // on a canvas three times as wide and high as the image around it, so that what the border cuts
  // off counts; visible_fraction = visible_px / silhouette_px. Both 0 for the background.
  std::int64_t silhouette_px = 0;
  PixelBox silhouette_box;  // may begin left of or above the image
  double visible_fraction = 0;
  // Samples of its surface: metrics/surface_samples.h with kVisibilitySamples, but for those inside
  // the object. Seen: as SampleStatus::kVisible (metrics/visibility.h), and so on;
  // `hidden_by` counts kBehindOther by the object in front.
  std::int64_t samples = 0;
  std::int64_t seen = 0;
  std::int64_t behind_itself = 0;
  std::int64_t outside = 0;
  std::int64_t unmeasured = 0;
  std::map<InstanceId, std::int64_t> hidden_by;
  bool operator==(const ObjectVisibility&) const = default;
};

// Two a square centimetre on the table and on objects, one in fifty on floor and walls, seed 1.
inline const SampleConfig kVisibilitySamples{2, 0.02, {"table"}, 1};

// Copies are cheap and independent, for threads of their own.
class VisibilityTruth {
 public:
  explicit VisibilityTruth(const std::vector<TrueModel>& models);

  // One entry for each model that has a pose in the frame (the background always has), ordered by
  // id. Uses the frame's exact depth and mask. Errors: kData where the images do not fit.
  Expected<std::vector<ObjectVisibility>> Measure(const Frame& frame);

 private:
  struct Object {
    std::shared_ptr<const TriangleMesh> mesh_O;
    SeenTracker tracker;
  };
  std::vector<Object> objects_;
};

// truth/visibility.csv: a header, then a line an object and frame.
std::string VisibilityHeader();
std::string VisibilityLine(const ObjectVisibility& visibility);

}  // namespace tsdfpp
