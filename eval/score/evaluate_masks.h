// Scores the masks that any mapper wrote (docs/evaluate.md).
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"
#include "core/types.h"
#include "eval/score/mesh_matching.h"
#include "metrics/segmentation.h"

namespace tsdfpp {

struct MaskEvaluation {
  int images = 0;
  std::map<int, InstanceId> object_of;  // of each predicted id; kNoInstance: of none
  std::map<InstanceId, Measured> iou;   // sums over the frames, of each object
  Measured mean_iou;                    // of these
  // Segments matched without regard to their ids (IoU above 1/2), all of one class.
  PanopticQuality quality;
  std::vector<std::string> remarks;  // sentences on what was left out
};

// Compares images of ids, 0 the background, with the frames' true masks.
class MaskEvaluator {
 public:
  // Errors: kUsage where there is no such folder; kData where it holds no image named after a
  // frame, or two of one.
  static Expected<MaskEvaluator> Open(const std::filesystem::path& folder);

  // Takes in a frame; one that the folder has no image of is passed over. Errors: kData where the
  // image cannot be read or has another size than the true mask.
  Expected<void> Observe(const Frame& frame);

  // Images of frames that the sequence `info` does not have are remarked on, those that no number
  // names, and those that hold no ids. With kNames ids are the sequence's objects where it has
  // them; else an id is the object with which it shares most pixels. Errors: kData where no frame
  // had an image.
  Expected<MaskEvaluation> Result(const SequenceInfo& info, const std::vector<ObjectInfo>& objects,
                                  MatchMode mode) const;

 private:
  std::filesystem::path folder_;
  std::map<int, std::filesystem::path> images_;  // by frame
  std::vector<std::string> unnumbered_;          // names of others, in order
  std::vector<std::string> not_ids_;             // names of images with another ending, in order
  LabelPairs pairs_;
  PanopticCounts counts_;
  int observed_ = 0;
};

nlohmann::json ToJson(const MaskEvaluation& evaluation);

}  // namespace tsdfpp
