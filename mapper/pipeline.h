// The mapping pipeline, a frame at a time (paper section III): segment, associate, track, update
// poses, fuse. Each verb but the last two, which are the map's own, is an object behind an
// interface with one function that does it; PipelineConfig says which. Where camera poses are not
// given (the paper's are), the camera is located between the first two.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mapper/associate/associator.h"
#include "mapper/associate/mask_repair_config.h"
#include "mapper/associate/vote_config.h"
#include "mapper/frame_counts.h"
#include "mapper/map_representation.h"
#include "mapper/segment/bleeding.h"
#include "mapper/segment/segmenter.h"
#include "mapper/track/camera_source.h"
#include "mapper/track/icp_registration.h"
#include "mapper/track/sdf_track_config.h"
#include "mapper/track/track_log.h"
#include "mapper/track/tracked_objects.h"
#include "mapper/track/tracker.h"

namespace tsdfpp {

class CameraTracker;
class LostObjects;
class MaskRepair;

// All that a pipeline is told.
struct PipelineConfig {
  Method method = Method::kTsdfpp;
  MapConfig map{};
  Segmentation segmentation = Segmentation::kGiven;
  SegmenterParts segmenter{};
  BleedingPixels bleeding = BleedingPixels::kAuto;
  AssociationMode associate = AssociationMode::kGiven;
  VoteConfig votes{};
  MaskRepairMode mask_repair = MaskRepairMode::kOff;
  MaskRepairConfig repair{};
  CameraSource camera = CameraSource::kGiven;
  PoseSource poses = PoseSource::kGiven;
  TrackChoice tracked = TrackChoice::kAuto;  // which objects, where poses are not given
  // The same, with kMoving for kAuto where `track` tracks segments of depth, which are furniture,
  // too.
  TrackChoice Tracked() const;
  IcpConfig icp{};
  SdfTrackConfig track{};  // of the camera, too

  // Whether pixels that bleed wait, as `bleeding` says or, where it is kAuto, the tracking.
  bool BleedingWaits() const;

  // Errors: kUsage where a part is wrong, given poses, which are those of given ids, are to go with
  // association by votes, or given ids with segments whose ids are of one frame alone.
  Expected<void> Validate() const;
};

// Wall-clock seconds of the steps of one frame.
struct StepTimes {
  double segment_s = 0;       // paper III-B; with given masks that of outlines and bleeding, or 0
  double locate_s = 0;        // the camera; 0 with given poses of it
  double associate_s = 0;     // paper III-C: votes; 0 with given ids
  double track_s = 0;         // paper III-D: objects' meshes, ICP; 0 with given poses
  double update_poses_s = 0;  // paper III-E
  double repair_s = 0;        // of labels, by the map; 0 where they are not repaired
  double fuse_s = 0;          // paper III-F
  double Total_s() const {
    return segment_s + locate_s + associate_s + track_s + update_poses_s + repair_s + fuse_s;
  }
};

// The name of an object that nobody named: "background", or "object" and its id.
std::string NameOfUnlisted(InstanceId id);

class Pipeline {
 public:
  // `objects` are what the ids of the frames' masks stand for; none where those are of one frame
  // alone. The config must be valid.
  Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects);

  // Goes on from a map, which must have the config's method and settings, and T_WO of its objects
  // by frame (mapper/map_file.h); where an object is, the map says, if it can. With votes `born`
  // are the objects of the map.
  Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects,
           std::unique_ptr<MapRepresentation> map,
           std::map<InstanceId, std::map<int, Pose>> trajectories,
           const std::vector<ObjectInfo>& born = {});
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  // Maps one frame; not where its camera is lost. Errors: kData, a sentence that begins with the
  // frame's number, where it is no frame (its mask is missing, say) or something lies beyond the
  // map's range (mapper/map_reach.h); the map is then as it was.
  Expected<StepTimes> Process(const Frame& frame);

  const MapRepresentation& map() const { return *map_; }

  // What whoever asked for the map should know, a sentence each: that no frame has put anything
  // into it, with counts of what the frames held; that it is so far from the origin that rounding
  // shows; that objects were to be tracked and none was; which are lost; those of the association.
  std::vector<std::string> Remarks() const;

  // The objects of the pixels of the frame mapped last, as associated; empty before the first.
  const cv::Mat& labels() const { return labels_; }

  // The objects of the map. With given ids those that the pipeline was made with, and then those
  // that masks showed besides, by id (NameOfUnlisted(), and underscores where another is named so).
  // With votes those
  // that were born ("object1", ...), by id, the background first, with the classes that segments
  // brought.
  std::vector<ObjectInfo> Objects() const;

  // T_WO of each object as the map has it, by frame index. Tracked, the object's frame O is its
  // lattice: the identity where it was first seen.
  const std::map<InstanceId, std::map<int, Pose>>& trajectories() const { return trajectories_; }

  // What was tracked, and when; empty with given poses.
  const TrackLog& track_log() const { return track_log_; }

  // Where the camera was; empty with given poses of it.
  const CameraLog& camera_log() const;

  // What another run goes on from (MappedRun); nothing where the last pose was taken as given.
  const std::optional<CameraPlace>& camera_place() const;
  // Goes on from a map whose last frame's camera was found there. To be told before the first
  // frame.
  void GoOnFrom(const CameraPlace& place);

  // Which objects are tracked where poses are not given.
  const TrackedObjects& tracked() const { return tracked_; }

 private:
  // Where the objects are after a frame, and which of its pixels may be fused into which of them.
  struct TrackedFrame {
    ObjectPoses T_WO;
    cv::Mat labels;
    std::map<InstanceId, TrackStatus> seen;
  };
  // Errors: the segmenter's, and those of CheckFrameForm.
  Expected<Segments> Segment(const Frame& frame);
  // Nothing of the frame counts before the map is known to take it. Errors: those of CheckReach.
  Expected<TrackedFrame> Track(const Frame& frame, const AssociatedObjects& association);
  // Puts lost objects whose segments are found into the map, and returns them; takes the labels off
  // the segments of those that are not.
  std::vector<InstanceId> FindAgain(const Frame& frame, AssociatedObjects& association);
  // Of the asked objects of T_WO.
  void KeepThoseNotInPlace(const Frame& frame, const AssociatedObjects& association,
                           const ObjectPoses& T_WO,
                           const std::function<bool(InstanceId)>& is_asked);
  // Takes those out of the map that the frame shows not to be in their place.
  void TakeOutLost(const Frame& frame, const AssociatedObjects& association,
                   const std::vector<InstanceId>& found, TrackedFrame& tracked);
  // Moves the objects to where they are after the frame, and writes it down.
  void UpdatePoses(int frame, ObjectPoses T_WO);
  // The labels to fuse, where the objects are now.
  cv::Mat RepairMasks(const Frame& frame, const TrackedFrame& tracked);
  void Fuse(const Frame& frame, const cv::Mat& labels);
  // Looks at the pixels only while the map is empty.
  void CountWhileEmpty(const Frame& frame, const cv::Mat& labels);

  PipelineConfig config_;
  std::unique_ptr<Segmenter> segmenter_;
  std::unique_ptr<CameraTracker> camera_;
  std::unique_ptr<Associator> associator_;
  std::unique_ptr<Tracker> tracker_;
  std::unique_ptr<LostObjects> lost_;   // nullptr where none can be
  std::unique_ptr<MaskRepair> repair_;  // nullptr where masks are not repaired
  std::unique_ptr<MapRepresentation> map_;
  ObjectPoses T_WO_;
  ObjectPoses T_WO_gone_;  // where those of a loaded map were last that it has nothing of
  std::map<InstanceId, std::map<int, Pose>> trajectories_;
  TrackLog track_log_;
  std::vector<ObjectInfo> objects_;
  TrackedObjects tracked_;
  cv::Mat labels_;
  bool is_empty_ = true;   // no block has been in the map yet
  FrameCounts in_vain_;    // of the frames until then
  double farthest_m_ = 0;  // along an axis, of the cameras
};

}  // namespace tsdfpp
