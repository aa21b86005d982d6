// Scores a folder of segmented images against true ones (docs/metrics.md, `metric panoptic`).
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"
#include "metrics/segmentation.h"
#include "metrics/tracking_quality.h"

namespace tsdfpp {

// Labels of STQ: (class << kLabelInstanceBits) + instance.
inline constexpr int kLabelInstanceBits = 16;
inline constexpr int kMostLabelClasses = 1 << 14;

// The whole comparison.
struct PanopticEvaluation {
  PanopticCounts counts;
  std::map<int, bool> is_thing;             // by class; empty where nobody says
  std::optional<LabelOverlap> overlap;      // of labels; not of COCO's ids
  std::optional<TrackingQuality> tracking;  // of things; the images are one sequence
  int images = 0;
};

// Images of ids (R + 256 G + 65536 B) and the annotations of their segments.
struct CocoFolder {
  std::filesystem::path images;
  std::filesystem::path json;
};

// Scores the predictions of all images that the truth has annotations of. Those of others are left
// out, which a line in `remarks` says. Errors: kData where a
// file cannot be read, an image has no prediction, a category is not the truth's, or image and
// annotations disagree.
Expected<PanopticEvaluation> EvaluateCoco(const CocoFolder& truth, const CocoFolder& prediction,
                                          std::vector<std::string>* remarks);

// What the numbers of an image of labels mean.
struct LabelEncoding {
  bool objects = false;  // an id an object, each a class of its own; 0 is the background
  int divisor = 1000;    // otherwise class * divisor + instance; class 0 is void
  std::set<int> things;  // the classes that have instances
};

// Scores the images (.png) of one folder against those of the same name in the other, in order of
// their names. With things, or of objects, also as one sequence (STQ). Predictions without a true
// image are left out, which a line in `remarks` says. Errors: kData where a folder has no images or
// lacks some of the truth's, an image cannot be read, or two differ in size.
Expected<PanopticEvaluation> EvaluateLabels(const std::filesystem::path& truth,
                                            const std::filesystem::path& prediction,
                                            const LabelEncoding& encoding,
                                            std::vector<std::string>* remarks);

}  // namespace tsdfpp
