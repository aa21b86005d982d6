// Writes any stream of frames as a Co-Fusion set with our extra files (sequence.json, models/).
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {

// Called after each frame with the number of frames done and of all frames.
using ProgressCallback = std::function<void(int done, int total)>;

// Writes all frames and the true models of `source` into the folder `out`. The frames that
// OpenCofusion reads back have the same bytes, poses included if they went through text
// (core/pose_text.h), and the time (index - first_index) / rate.
// The folder appears whole or not at all: files are made in a hidden folder beside it, renamed at
// the end. An existing folder must be empty or, with `overwrite`, an earlier sequence of ours.
// Errors: those of the source; kUsage where the folder may not be replaced or an object's name or
// id does not fit into a file name or an 8-bit mask; kData where a frame does not fit the source's
// own description; kEnvironment where the disk refuses.
Expected<void> WriteCofusion(FrameSource& source, const GeneratorInfo& generator,
                             const std::filesystem::path& out, bool overwrite = false,
                             const ProgressCallback& progress = {});

// The steps of WriteCofusion, for those who write frames in any order or from several processes.

// What a sensor with faults gave in place of the truth. Where a part is absent it equals the truth.
struct SensedImages {
  cv::Mat depth;  // as Frame's; may be empty
  cv::Mat mask;   // as Frame's; may be empty
  std::optional<Pose> T_WC;
};

// A frame whose images are on disk: all that is needed to finish the set.
struct WrittenFrame {
  int index = 0;
  Pose T_WC = Pose::Identity();
  std::optional<Pose> sensed_T_WC;
  std::map<InstanceId, Pose> T_WO;
  bool has_mask = false;
  std::map<std::string, std::string> hashes;  // of the frame's files
};

// Errors: kUsage, as WriteCofusion's, where an object does not fit.
Expected<void> CheckObjectsFit(const std::vector<ObjectInfo>& objects);

// Writes the images of a frame into `folder`, each file whole or not at all: the frame's own to the
// places of the truth, and what was sensed beside them. (Colour is always as sensed.)
// Errors: those of WriteCofusion that are about frames or the disk.
Expected<WrittenFrame> WriteCofusionFrame(const SequenceInfo& info, const Frame& frame,
                                          const std::optional<SensedImages>& sensed,
                                          const std::filesystem::path& folder);

// Writes all else: calibration, trajectories, models, `more_files` (bytes by the path in the set)
// and sequence.json, which it returns. Files other than those of the set are removed from the
// folder. `frames` in order. Errors: kData where a mask or a pose does not fit; kEnvironment.
Expected<SequenceRecord> FinishCofusion(const SequenceInfo& info, const GeneratorInfo& generator,
                                        const std::vector<WrittenFrame>& frames,
                                        const std::vector<TrueModel>& models,
                                        const std::map<std::string, std::string>& more_files,
                                        const std::filesystem::path& folder);

}  // namespace tsdfpp
