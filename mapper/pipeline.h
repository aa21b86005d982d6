// The mapping pipeline, a frame at a time (paper section III): segment, associate, track, update
// poses, fuse. With ground-truth masks the first two are the identity: the mask's ids are the map's
// objects.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "mapper/frame_counts.h"
#include "mapper/icp_tracker.h"
#include "mapper/map_representation.h"

namespace tsdfpp {

enum class PoseSource {
  kGiven,  // Frame::T_WO
  kIcp,    // tracked; Frame::T_WO is not read
};

// "gt" or "icp". Errors: kUsage.
Expected<PoseSource> PoseSourceFromName(std::string_view name);
std::string_view PoseSourceName(PoseSource source);

struct PipelineConfig {
  Method method = Method::kTsdfpp;
  MapConfig map;
  PoseSource poses = PoseSource::kGiven;
  IcpConfig icp;
};

// Wall-clock seconds of the steps of one frame.
struct StepTimes {
  double track_s = 0;         // segments, object meshes, ICP; 0 with given poses
  double update_poses_s = 0;  // paper III-E
  double fuse_s = 0;          // paper III-F
};

class Pipeline {
 public:
  // `objects` are those of the sequence; only those with a semantic class are tracked (paper
  // III-D). The config must be valid.
  Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects);

  // Goes on from a map, which must have the config's method and settings, and T_WO of its objects
  // by frame (mapper/map_file.h).
  Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects,
           std::unique_ptr<MapRepresentation> map,
           std::map<InstanceId, std::map<int, Pose>> trajectories);

  // Maps one frame. Errors: kData, a sentence that begins with the frame's number, where it is no
  // frame (its mask is missing, say) or something lies beyond the map's range
  // (mapper/lattice_range.h); the map is then as it was.
  Expected<StepTimes> Process(const Frame& frame);

  const MapRepresentation& map() const { return *map_; }

  // What whoever asked for the map should know, a sentence each: that no frame has put anything
  // into it, with counts of what the frames held; that it is so far from the origin that rounding
  // shows.
  std::vector<std::string> Remarks() const;

  // T_WO of each object as the map has it, by frame index. With ICP the object's frame O is its
  // lattice: the identity where it was first seen.
  const std::map<InstanceId, std::map<int, Pose>>& trajectories() const { return trajectories_; }

 private:
  // The relative motion of each tracked object that the frame shows, by id.
  std::map<InstanceId, Pose> Track(const Frame& frame) const;
  // T_WO of the objects after the frame.
  std::map<InstanceId, Pose> PosesAfter(const Frame& frame) const;
  // Looks at the pixels only while the map is empty.
  void CountWhileEmpty(const Frame& frame);

  PipelineConfig config_;
  std::set<InstanceId> tracked_;  // ids with a semantic class
  std::unique_ptr<MapRepresentation> map_;
  std::map<InstanceId, Pose> T_WO_;
  std::map<InstanceId, std::map<int, Pose>> trajectories_;
  bool is_empty_ = true;   // no block has been in the map yet
  FrameCounts in_vain_;    // of the frames until then
  double farthest_m_ = 0;  // along an axis, of the cameras
};

}  // namespace tsdfpp
