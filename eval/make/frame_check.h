// Do depth, mask and poses of a frame agree with the true models? No scene and no renderer is
// needed.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/types.h"
#include "metrics/truth_surface.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {

// Something that is wrong with a sequence.
struct Finding {
  std::string check;    // "files", "models", "depth", "mask", "pose", "rays", "visibility", "scene"
  std::string subject;  // the file, relative to the set's folder
  int frame = -1;       // -1 where it is about no single frame
  std::string sentence;  // without the subject
  bool operator==(const Finding&) const = default;
};

// Gathers residuals. Meters that are merged in the same order give the same numbers.
class ResidualMeter {
 public:
  explicit ResidualMeter(double limit_m) { residual_.limit_m = limit_m; }
  void Add(double error_m);
  void Exclude(std::int64_t pixels) { residual_.excluded += pixels; }
  void Merge(const ResidualMeter& other);
  Residual Result() const;

 private:
  static constexpr int kBins = 200;  // up to the limit
  Residual residual_;                // without mean and percentile
  double sum_m_ = 0;
  std::array<std::int64_t, kBins + 1> bins_{};  // the last: beyond the limit
};

// How far the point of a pixel may be from the model of the mask's object.
inline constexpr double kModelLimit_m = 2e-4;

struct FrameReport {
  ResidualMeter model{kModelLimit_m};
  std::vector<Finding> findings;
};

class FrameCheck {
 public:
  explicit FrameCheck(std::vector<TrueModel> models);

  // Each pixel's point (depth times ray) must lie on the model of the mask's object at its pose, to
  // kModelLimit_m: the exact distance to the nearest triangle, or to the one that the pixel's ray
  // hits first where that is within the limit. Left out, and counted, are points up to a millimetre
  // (a tenth of a pixel, where that is more) off, if they are beside another object or a step in
  // depth, or where the nearest triangle is seen at 80 degrees or more; unless a frame has
  // more than a few of them. What is off is put down to the mask (the points lie on another
  // object), the depth's unit, an object's pose (all of its points and no others are off), or else
  // camera pose and depth. Safe to call from several threads.
  FrameReport Check(const Frame& frame) const;

 private:
  std::map<InstanceId, std::unique_ptr<TruthSurface>> surfaces_;
};

}  // namespace tsdfpp
