#include "mapper/pipeline.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

#include "mapper/associate/given_ids.h"
#include "mapper/map_reach.h"
#include "mapper/track/frozen_pixels.h"
#include "mapper/track/given_poses.h"
#include "mapper/track/pcl_icp.h"
#include "mapper/track/sdf_tracker.h"

namespace tsdfpp {
namespace {

// Voxels from the origin beyond which a coordinate in single precision is off by more than a
// sixteenth of one.
constexpr double kExactVoxels = 1 << 20;

class StopWatch {
 public:
  // Seconds since the last call or the start.
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

std::unique_ptr<Tracker> MakeTracker(const PipelineConfig& config, const TrackedObjects& tracked) {
  switch (config.poses) {
    case PoseSource::kGiven:
      return std::make_unique<GivenPoses>();
    case PoseSource::kIcp:
      return std::make_unique<PclIcp>(config.icp, tracked);
    case PoseSource::kTrack:
      return std::make_unique<SdfTracker>(config.track, tracked);
  }
  std::abort();
}

}  // namespace

Pipeline::Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects)
    : Pipeline(config, objects, MakeMap(config.method, config.map), {}) {}

Pipeline::Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects,
                   std::unique_ptr<MapRepresentation> map,
                   std::map<InstanceId, std::map<int, Pose>> trajectories)
    : config_(config),
      tracked_(config.tracked, objects),
      segmenter_(MakeSegmenter(config.segmentation)),
      associator_(std::make_unique<GivenIds>()),
      tracker_(MakeTracker(config, tracked_)),
      map_(std::move(map)),
      trajectories_(std::move(trajectories)) {
  is_empty_ = map_->Memory().blocks == 0;
  for (const auto& [id, poses] : trajectories_) {
    if (!poses.empty()) T_WO_[id] = poses.rbegin()->second;
  }
}

Expected<StepTimes> Pipeline::Process(const Frame& frame) {
  StepTimes times;
  StopWatch watch;
  TSDFPP_ASSIGN(const cv::Mat segments, segmenter_->Segment(frame));
  TSDFPP_RETURN_IF_ERROR(CheckFrameForm(frame, segments));
  times.segment_s = watch.Lap();
  const cv::Mat associated = associator_->Associate(frame, segments, *map_);
  times.associate_s = watch.Lap();
  TrackedPoses tracked = tracker_->Track(frame, associated, *map_, T_WO_);
  const cv::Mat labels = LabelsToFuse(frame, associated, *map_, tracked);
  TSDFPP_RETURN_IF_ERROR(CheckReach(*map_, frame, labels, tracked.T_WO));
  times.track_s = watch.Lap();
  if (config_.poses != PoseSource::kGiven) track_log_.Add(frame.index, tracked);
  UpdatePoses(frame.index, std::move(tracked.T_WO));
  times.update_poses_s = watch.Lap();
  map_->Fuse(frame, labels);
  times.fuse_s = watch.Lap();
  CountWhileEmpty(frame, labels);
  farthest_m_ = std::max(farthest_m_, frame.T_WC.translation().cwiseAbs().maxCoeff());
  return times;
}

void Pipeline::UpdatePoses(int frame, ObjectPoses T_WO) {
  T_WO_ = std::move(T_WO);
  for (const auto& [id, pose] : T_WO_) {
    map_->SetObjectPose(id, pose);
    trajectories_[id][frame] = pose;
  }
}

void Pipeline::CountWhileEmpty(const Frame& frame, const cv::Mat& labels) {
  if (!is_empty_) return;
  is_empty_ = map_->Memory().blocks == 0;
  if (is_empty_) in_vain_.Add(frame, labels);
}

std::vector<std::string> Pipeline::Remarks() const {
  std::vector<std::string> remarks;
  if (is_empty_) remarks.push_back("the map is empty: " + in_vain_.Text());
  const double voxels = farthest_m_ / config_.map.voxel_m;
  if (voxels > kExactVoxels) {
    remarks.push_back(fmt::format(
        "the camera is up to {:.6g} m from the origin along an axis, where single precision rounds "
        "by up to {:.2g} voxels, which blurs surfaces; poses nearer to the origin would help",
        farthest_m_, voxels * std::numeric_limits<float>::epsilon() / 2));
  }
  if (config_.poses != PoseSource::kGiven && track_log_.frames() > 0 && track_log_.IsEmpty()) {
    remarks.push_back(
        fmt::format("objects were to be tracked (--poses {}) and none was: no frame shows one of "
                    "those that are "
                    "({})",
                    PoseSourceName(config_.poses), TrackChoiceName(tracked_.choice())));
  }
  return remarks;
}

}  // namespace tsdfpp
