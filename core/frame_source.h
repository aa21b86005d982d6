// A stream of frames, from a simulator in memory or from a dataset on disk.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// The paper's reveal (section IV): after this frame these objects are removed from the map.
struct RevealPlan {
  int frame = 0;
  std::vector<InstanceId> removed;
  bool operator==(const RevealPlan&) const = default;
};

struct SequenceInfo {
  std::string name;
  Intrinsics intrinsics;
  int first_index = 1;
  int frame_count = 0;
  double rate_hz = 30;
  std::vector<ObjectInfo> objects;  // ordered by id, background first
  std::optional<RevealPlan> reveal;
  // Whether an id in the frames' masks is the same object in every frame, one of `objects`; else
  // ids are of one frame alone.
  bool mask_ids_are_objects = true;
  // Whether frames say where objects are (Frame::T_WO); what stands still has no need of it.
  bool has_object_poses = true;
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual const SequenceInfo& info() const = 0;
  // The frame with this file number, in [first_index, first_index + frame_count).
  // Errors: kUsage where the number is out of range, kData where a file is missing or unusable,
  // kEnvironment where rendering fails.
  virtual Expected<Frame> Read(int index) = 0;
  // Whether Read() gives what a sensor with faults made of the frames.
  virtual bool IsSensed() const { return false; }
  // The same frame as it was, where Read() gives what a sensor with faults made of it: true depth,
  // mask and camera pose, for evaluation only; colour as Read()'s. Errors: those of Read().
  virtual Expected<Frame> ReadTrue(int index) { return Read(index); }
  // Whether there are true surfaces; those in files may be unreadable all the same.
  virtual bool HasTruth() const { return true; }
  // The true surfaces, for evaluation only. Error kData where the source has none.
  virtual Expected<std::vector<TrueModel>> Truth() = 0;
};

}  // namespace tsdfpp
