#include "mapper/pipeline.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

#include "mapper/lattice_range.h"

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

std::set<InstanceId> LabelsIn(const cv::Mat& labels) {
  std::set<InstanceId> ids;
  InstanceId last = kNoInstance;
  for (int v = 0; v < labels.rows; ++v) {
    const auto* row = labels.ptr<InstanceId>(v);
    for (int u = 0; u < labels.cols; ++u) {
      if (row[u] != last) ids.insert(last = row[u]);
    }
  }
  ids.erase(kNoInstance);
  return ids;
}

}  // namespace

Expected<PoseSource> PoseSourceFromName(std::string_view name) {
  if (name == "gt") return PoseSource::kGiven;
  if (name == "icp") return PoseSource::kIcp;
  return UsageError("pose source '{}' is unknown, expected gt or icp", name);
}

std::string_view PoseSourceName(PoseSource source) {
  return source == PoseSource::kGiven ? "gt" : "icp";
}

Pipeline::Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects)
    : Pipeline(config, objects, MakeMap(config.method, config.map), {}) {}

Pipeline::Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects,
                   std::unique_ptr<MapRepresentation> map,
                   std::map<InstanceId, std::map<int, Pose>> trajectories)
    : config_(config), map_(std::move(map)), trajectories_(std::move(trajectories)) {
  is_empty_ = map_->Memory().blocks == 0;
  for (const auto& [id, poses] : trajectories_) {
    if (!poses.empty()) T_WO_[id] = poses.rbegin()->second;
  }
  for (const ObjectInfo& object : objects) {
    if (object.id != kBackground && !object.semantic_class.empty()) tracked_.insert(object.id);
  }
}

std::map<InstanceId, Pose> Pipeline::Track(const Frame& frame) const {
  std::map<InstanceId, Pose> motions;
  for (const InstanceId id : LabelsIn(frame.mask)) {
    if (!tracked_.contains(id)) continue;
    if (!T_WO_.contains(id)) {
      // First seen: its frame is its lattice, where it is.
      motions.emplace(id, Pose::Identity());
      continue;
    }
    const TriangleMesh model_W = map_->ObjectMesh(id);
    const TrackResult result = TrackObject(SegmentPoints(frame, frame.mask, id, config_.icp),
                                           model_W, config_.map.voxel_m, config_.icp);
    motions.emplace(id, result.T_O);
  }
  return motions;
}

std::map<InstanceId, Pose> Pipeline::PosesAfter(const Frame& frame) const {
  std::map<InstanceId, Pose> poses = T_WO_;
  if (config_.poses == PoseSource::kIcp) {
    for (const auto& [id, T_O] : Track(frame)) {
      const auto known = T_WO_.find(id);
      poses[id] = known == T_WO_.end() ? T_O : Pose(T_O * known->second);
    }
  } else {
    for (const auto& [id, T_WO] : frame.T_WO) poses[id] = T_WO;
  }
  return poses;
}

Expected<StepTimes> Pipeline::Process(const Frame& frame) {
  StepTimes times;
  StopWatch watch;
  TSDFPP_RETURN_IF_ERROR(CheckFrameForm(frame, frame.mask));
  std::map<InstanceId, Pose> poses = PosesAfter(frame);
  TSDFPP_RETURN_IF_ERROR(CheckReach(*map_, frame, frame.mask, poses));
  T_WO_ = std::move(poses);
  times.track_s = watch.Lap();
  for (const auto& [id, T_WO] : T_WO_) {
    map_->SetObjectPose(id, T_WO);
    trajectories_[id][frame.index] = T_WO;
  }
  times.update_poses_s = watch.Lap();
  map_->Fuse(frame, frame.mask);
  times.fuse_s = watch.Lap();
  CountWhileEmpty(frame);
  farthest_m_ = std::max(farthest_m_, frame.T_WC.translation().cwiseAbs().maxCoeff());
  return times;
}

void Pipeline::CountWhileEmpty(const Frame& frame) {
  if (!is_empty_) return;
  is_empty_ = map_->Memory().blocks == 0;
  if (is_empty_) in_vain_.Add(frame, frame.mask);
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
  return remarks;
}

}  // namespace tsdfpp
