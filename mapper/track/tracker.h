// Where each object is after a frame (paper III-D): the third verb of the pipeline.
#pragma once

#include <map>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "mapper/map_representation.h"
#include "mapper/track/motion_uncertainty.h"

namespace tsdfpp {

// T_WO by object.
using ObjectPoses = std::map<InstanceId, Pose>;

// What became of an object that a frame shows.
enum class TrackStatus {
  kBegun,    // it had no pose yet
  kTracked,  // it was registered
  kStayed,   // it was not, and is taken to be where it was
  kFrozen,   // it was not, and may be elsewhere: nothing of the frame may be fused into it
};

// What a tracker says of a frame.
struct TrackedPoses {
  ObjectPoses T_WO;                          // of all objects that have had a pose
  std::map<InstanceId, TrackStatus> seen{};  // of those that are tracked and that the frame shows
  // Of those that were registered by a tracker that knows: how well their motion since is known.
  std::map<InstanceId, MotionUncertainty> motions{};
  // Of those that the frame shows: which are known to have moved since they began, by a tracker
  // that waits for that.
  std::vector<InstanceId> moved{};
};

// The model of an object that is put somewhere.
enum class PlacedModel {
  kSame,   // the one that it was tracked by last
  kOther,  // perhaps not
};

class Tracker {
 public:
  virtual ~Tracker() = default;

  // The objects' poses after the frame, of all that have had one, by their poses before it.
  // `labels` is the frame's objects that are tracked (mapper/track/tracked_objects.h), as
  // associated with the map, which holds what was fused before the frame; the rest is kBackground
  // or, where it may be an object, kNoInstance.
  virtual TrackedPoses Track(const Frame& frame, const cv::Mat& labels,
                             const MapRepresentation& map, const ObjectPoses& before) = 0;

  // Called before Track() where an object was put where it is in that frame, by others: how it
  // moved before says nothing any more, and how it was seen only of the model that it has.
  virtual void Place(InstanceId /*id*/, int /*frame*/, PlacedModel /*model*/) {}
};

enum class PoseSource {
  kGiven,  // Frame::T_WO
  kIcp,    // tracked as in the paper; Frame::T_WO is not read
  kTrack,  // tracked by signed distances (mapper/track/sdf_tracker.h); neither
};

// "gt", "icp" or "track". Errors: kUsage.
Expected<PoseSource> PoseSourceFromName(std::string_view name);
std::string_view PoseSourceName(PoseSource source);
// As titles say it: "given poses", "ICP" or "tracked".
std::string_view PoseSourceTitle(PoseSource source);

// Errors: kUsage, a sentence, where the method's maps have not what the poses are tracked by.
Expected<void> CheckPoses(Method method, PoseSource poses);

}  // namespace tsdfpp
