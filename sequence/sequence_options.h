// How a dataset is to be opened: what its files do not say about themselves.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

enum class DatasetFormat { kCofusion, kTum, kBop, kKlg, kScannet, kReplica, kSevenScenes };

// "cofusion", "tum", "bop", "klg", "scannet", "replica", "7scenes".
const char* DatasetFormatName(DatasetFormat format);
const std::vector<DatasetFormat>& AllDatasetFormats();
// Errors: kUsage, naming those there are.
Expected<DatasetFormat> DatasetFormatFromName(std::string_view name);

struct SequenceOptions {
  // Detected from the folder where absent.
  std::optional<DatasetFormat> format;
  // Replaces what is on disk or the format's default. Width and height 0: those of the images. A
  // negative fy is an image whose y axis points up (ICL-NUIM): world and cameras are mirrored in y,
  // so that every later number is that of a camera with y down.
  std::optional<Intrinsics> intrinsics;
  // Depth values in one metre, in place of the format's (docs/datasets.md).
  std::optional<double> depth_units_per_m;
  // Take a camera whose poses are not on disk as one that does not move. Without it that is an
  // error.
  bool fixed_camera = false;
  // Seconds. An image's camera pose is that of groundtruth.txt this much after the image's time
  // (negative: before it), where the two were written by clocks that do not agree. Of tum and klg.
  double pose_offset_s = 0;
  // Look at a few frames for wrong units, inverted poses and the like (sequence/plausibility.h).
  bool check = true;
};

// Sentences on what a reader assumed or left out, e.g. default intrinsics; not errors.
using SequenceNotes = std::vector<std::string>;

}  // namespace tsdfpp
