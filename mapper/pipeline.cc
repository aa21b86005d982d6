#include "mapper/pipeline.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <utility>

#include "mapper/associate/given_ids.h"
#include "mapper/associate/mask_repair.h"
#include "mapper/associate/voxel_votes.h"
#include "mapper/map_persistence.h"
#include "mapper/map_reach.h"
#include "mapper/track/camera_tracker.h"
#include "mapper/track/frozen_pixels.h"
#include "mapper/track/given_poses.h"
#include "mapper/track/lost_objects.h"
#include "mapper/track/object_model.h"
#include "mapper/track/pcl_icp.h"
#include "mapper/track/sdf_tracker.h"
#include "mapper/volume/lattice_range.h"

namespace tsdfpp {
namespace {

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

std::unique_ptr<Tracker> MakeTracker(const PipelineConfig& config) {
  switch (config.poses) {
    case PoseSource::kGiven:
      return std::make_unique<GivenPoses>();
    case PoseSource::kIcp:
      return std::make_unique<PclIcp>(config.icp);
    case PoseSource::kTrack:
      return std::make_unique<SdfTracker>(config.track, ModelOf,
                                          config.Tracked() == TrackChoice::kMoving);
  }
  std::abort();
}

// The least id above those that a map has had.
InstanceId NextId(const std::vector<ObjectInfo>& born,
                  const std::map<InstanceId, std::map<int, Pose>>& trajectories) {
  int next = kBackground + 1;
  for (const ObjectInfo& object : born) next = std::max(next, object.id + 1);
  if (!trajectories.empty()) next = std::max(next, trajectories.rbegin()->first + 1);
  return static_cast<InstanceId>(next);
}

std::unique_ptr<Associator> MakeAssociator(
    const PipelineConfig& config, const std::vector<ObjectInfo>& born,
    const std::map<InstanceId, std::map<int, Pose>>& trajectories) {
  switch (config.associate) {
    case AssociationMode::kGiven:
      return std::make_unique<GivenIds>();
    case AssociationMode::kVotes: {
      VoteConfig votes = config.votes;
      if (votes.far_share < 0) {
        const bool repairs = config.mask_repair == MaskRepairMode::kOn;
        votes.far_share = repairs ? VoteConfig::kUsualFarShare : 0;
      }
      return std::make_unique<VoxelVotes>(votes, NextId(born, trajectories));
    }
  }
  std::abort();
}

// Poses that are as far from rigid as a frame's may be, multiplied, are none that a map takes.
Frame WithRotations(Frame frame) {
  frame.T_WC = NearestRigid(frame.T_WC);
  for (auto& [id, T_WO] : frame.T_WO) T_WO = NearestRigid(T_WO);
  return frame;
}

}  // namespace

bool PipelineConfig::BleedingWaits() const {
  if (bleeding != BleedingPixels::kAuto) return bleeding == BleedingPixels::kWait;
  return poses == PoseSource::kTrack || camera != CameraSource::kGiven;
}

TrackChoice PipelineConfig::Tracked() const {
  const bool is_of_depth = segmentation == Segmentation::kDepth && poses == PoseSource::kTrack;
  return tracked == TrackChoice::kAuto && is_of_depth ? TrackChoice::kMoving : tracked;
}

Expected<void> PipelineConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(map.Validate());
  TSDFPP_RETURN_IF_ERROR(segmenter.depth.Validate());
  TSDFPP_RETURN_IF_ERROR(segmenter.network.Validate());
  TSDFPP_RETURN_IF_ERROR(votes.Validate());
  TSDFPP_RETURN_IF_ERROR(repair.Validate());
  TSDFPP_RETURN_IF_ERROR(icp.Validate());
  TSDFPP_RETURN_IF_ERROR(track.Validate());
  TSDFPP_RETURN_IF_ERROR(CheckPoses(method, poses));
  if (tracked == TrackChoice::kMoving && poses != PoseSource::kTrack) {
    return UsageError("--track moving needs --poses track, found --poses {}",
                      PoseSourceName(poses));
  }
  TSDFPP_RETURN_IF_ERROR(CheckCamera(method, camera));
  if (UsesNetwork(segmentation) && segmenter.finder == nullptr) {
    return UsageError("segmentation '{}' has nobody who finds instances, expected a network",
                      SegmentationName(segmentation));
  }
  if (IdsAreOfOneFrame(segmentation) && associate == AssociationMode::kGiven) {
    return UsageError(
        "the ids of segmentation '{}' are drawn anew in every frame: expected association by votes",
        SegmentationName(segmentation));
  }
  if (associate == AssociationMode::kVotes && !InfoOf(method).has_voxels) {
    return UsageError(
        "association by votes asks a map for its voxels, which method '{}' has not, expected given "
        "ids",
        MethodName(method));
  }
  TSDFPP_RETURN_IF_ERROR(CheckMaskRepair(method, mask_repair));
  if (associate == AssociationMode::kVotes && poses == PoseSource::kGiven) {
    return UsageError(
        "given poses are those of given ids, and association by votes gives ids of its own: "
        "expected objects that are tracked, or given ids");
  }
  return {};
}

std::string NameOfUnlisted(InstanceId id) {
  return id == kBackground ? "background" : fmt::format("object{}", id);
}

Pipeline::Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects)
    : Pipeline(config, objects, MakeMap(config.method, config.map), {}) {}

Pipeline::Pipeline(const PipelineConfig& config, const std::vector<ObjectInfo>& objects,
                   std::unique_ptr<MapRepresentation> map,
                   std::map<InstanceId, std::map<int, Pose>> trajectories,
                   const std::vector<ObjectInfo>& born)
    : config_(config),
      segmenter_(MakeSegmenter(config.segmentation, objects, config.segmenter)),
      camera_(std::make_unique<CameraTracker>(config.camera, config.track)),
      associator_(MakeAssociator(config, born, trajectories)),
      tracker_(MakeTracker(config)),
      repair_(config.mask_repair == MaskRepairMode::kOn
                  ? std::make_unique<MaskRepair>(config.repair,
                                                 config.associate == AssociationMode::kVotes
                                                     ? MaskRepair::Births::kConfirmed
                                                     : MaskRepair::Births::kCounted)
                  : nullptr),
      map_(std::move(map)),
      trajectories_(std::move(trajectories)),
      objects_(config.associate == AssociationMode::kGiven ? objects : born),
      tracked_(config.Tracked(), objects_) {
  // One field cannot do without the values that an object has in it.
  if (config.poses == PoseSource::kTrack && map_->editing() != nullptr &&
      !IsOneField(config.method)) {
    lost_ = std::make_unique<LostObjects>(config.track);
  }
  is_empty_ = map_->Memory().blocks == 0;
  // Frame numbers may have gone back: the map knows which pose was the last one.
  const MapPersistence* kept = std::as_const(*map_).persistence();
  for (const auto& [id, poses] : trajectories_) {
    if (poses.empty()) continue;
    // One that was lost, or removed, is nowhere until it is seen again.
    if (lost_ != nullptr && !ModelOf(*map_, id)) {
      T_WO_gone_[id] = poses.rbegin()->second;
      continue;
    }
    const std::optional<Pose> last = kept == nullptr ? std::nullopt : kept->LastPose(id);
    T_WO_[id] = last.value_or(poses.rbegin()->second);
  }
}

Pipeline::~Pipeline() = default;
Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;

const CameraLog& Pipeline::camera_log() const { return camera_->log(); }
const std::optional<CameraPlace>& Pipeline::camera_place() const { return camera_->place(); }
void Pipeline::GoOnFrom(const CameraPlace& place) { camera_->GoOnFrom(place); }

Expected<StepTimes> Pipeline::Process(const Frame& given) {
  StepTimes times;
  StopWatch watch;
  TSDFPP_ASSIGN(const Segments segments, Segment(given));
  times.segment_s = watch.Lap();
  const std::optional<Frame> frame =
      camera_->Locate(WithRotations(given), segments.IdsOfObjects(), *map_);
  times.locate_s = watch.Lap();
  if (!frame) return times;
  if (lost_ != nullptr) associator_->ExpectReturns(lost_->Awaited(*frame, *map_));
  AssociatedObjects association = associator_->Associate(*frame, segments, *map_);
  associator_->ExpectReturns({});
  times.associate_s = watch.Lap();
  const std::vector<InstanceId> found = FindAgain(*frame, association);
  Expected<TrackedFrame> tracked = Track(*frame, association);
  if (!tracked) {
    if (lost_ != nullptr) lost_->Undo(found, *map_, T_WO_);
    return tl::unexpected(tracked.error());
  }
  camera_->Accept();
  TakeOutLost(*frame, association, found, *tracked);
  times.track_s = watch.Lap();
  UpdatePoses(frame->index, std::move(tracked->T_WO));
  times.update_poses_s = watch.Lap();
  const cv::Mat labels = RepairMasks(*frame, *tracked);
  times.repair_s = watch.Lap();
  Fuse(*frame, labels);
  times.fuse_s = watch.Lap();
  return times;
}

Expected<Segments> Pipeline::Segment(const Frame& frame) {
  TSDFPP_RETURN_IF_ERROR(CheckFrameForm(frame));
  TSDFPP_ASSIGN(Segments segments, segmenter_->Segment(frame));
  TSDFPP_RETURN_IF_ERROR(CheckFrameForm(frame, segments.ids));
  if (repair_ != nullptr) {
    segments.ids =
        repair_->SetOutlines(frame, segments.ids, config_.map.voxel_m, config_.segmenter.depth);
  }
  if (config_.BleedingWaits()) {
    const double step_m = kBleedingStep_voxels * config_.map.voxel_m;
    segments.ids = WithoutBleeding(frame.depth, segments.ids, static_cast<float>(step_m));
  }
  return segments;
}

Expected<Pipeline::TrackedFrame> Pipeline::Track(const Frame& frame,
                                                 const AssociatedObjects& association) {
  TrackedObjects chosen = tracked_;
  for (const auto& [id, name] : association.classes) chosen.Learn(id, name);
  ObjectPoses before = T_WO_;
  before.insert(T_WO_gone_.begin(), T_WO_gone_.end());
  TrackedPoses tracked = tracker_->Track(frame, chosen.Select(association.labels), *map_, before);
  const auto is_back = [&](const auto& gone) {
    const auto status = tracked.seen.find(gone.first);
    return status != tracked.seen.end() && status->second == TrackStatus::kBegun;
  };
  for (const auto& gone : T_WO_gone_) {
    if (!is_back(gone)) tracked.T_WO.erase(gone.first);
  }
  const cv::Mat labels = LabelsToFuse(frame, association.labels, *map_, tracked);
  TSDFPP_RETURN_IF_ERROR(CheckReach(*map_, frame, labels, tracked.T_WO));
  associator_->Accept();
  std::erase_if(T_WO_gone_, is_back);
  tracked_ = std::move(chosen);
  if (config_.poses != PoseSource::kGiven) track_log_.Add(frame.index, tracked);
  return TrackedFrame{std::move(tracked.T_WO), labels, std::move(tracked.seen)};
}

std::vector<InstanceId> Pipeline::FindAgain(const Frame& frame, AssociatedObjects& association) {
  std::vector<InstanceId> found;
  if (lost_ == nullptr) return found;
  auto pixels_of = PixelsByLabel(association.labels, 0);
  KeepThoseNotInPlace(frame, association, T_WO_,
                      [&](InstanceId id) { return !pixels_of.contains(id); });
  lost_->GiveUpUnsure(frame, pixels_of, *map_, T_WO_);
  lost_->AskTrials(frame, pixels_of);
  if (lost_->empty()) return found;
  std::vector<LostObjects::Segment> segments;
  for (std::size_t s = 0; s < association.unclaimed.size(); ++s) {
    segments.push_back(
        {association.unclaimed[s], kNoInstance, association.may_begin[s], association.is_known[s]});
  }
  cv::Mat labels = association.labels.clone();
  for (auto& [id, pixels] : pixels_of) {
    if (!lost_->Has(id)) continue;
    labels.setTo(static_cast<double>(kNoInstance), labels == static_cast<double>(id));
    segments.push_back({std::move(pixels), id});
  }
  const std::vector<LostObjects::Return> returns = lost_->FindAgain(frame, segments);
  for (const LostObjects::Return& of : returns) {
    if (!lost_->PutBack(of, *map_, T_WO_)) continue;
    associator_->Found(of.id);
    tracker_->Place(of.id, frame.index, of.model);
    found.push_back(of.id);
    for (const int pixel : segments[of.segment].pixels) {
      labels.at<InstanceId>(pixel / labels.cols, pixel % labels.cols) = of.id;
    }
  }
  // Those have an object now.
  for (const LostObjects::Return& of : returns) {
    const bool is_found = std::ranges::count(found, of.id) > 0;
    if (is_found && of.segment < association.unclaimed.size()) {
      association.unclaimed[of.segment].clear();
    }
  }
  association.labels = labels;
  return found;
}

void Pipeline::KeepThoseNotInPlace(const Frame& frame, const AssociatedObjects& association,
                                   const ObjectPoses& T_WO,
                                   const std::function<bool(InstanceId)>& is_asked) {
  if (!SaysWhatIsWhere(association.labels)) return;
  ObjectPoses asked;
  for (const auto& [id, pose] : T_WO) {
    if (is_asked(id)) asked.emplace(id, pose);
  }
  for (const InstanceId id : lost_->NotInPlace(frame, *map_, asked, association.unclaimed)) {
    lost_->Keep(id, *map_, asked.at(id));
  }
}

void Pipeline::TakeOutLost(const Frame& frame, const AssociatedObjects& association,
                           const std::vector<InstanceId>& found, TrackedFrame& tracked) {
  if (lost_ == nullptr) return;
  const auto is_frozen = [&](InstanceId id) {
    const auto status = tracked.seen.find(id);
    return status != tracked.seen.end() && status->second == TrackStatus::kFrozen;
  };
  std::vector<InstanceId> settled;
  for (const InstanceId id : found) {
    const bool begins_anew = !ModelOf(*map_, id);
    // Too little of it to begin with: it stays lost.
    if (begins_anew && is_frozen(id)) {
      tracked.T_WO.erase(id);
      continue;
    }
    settled.push_back(id);
    if (begins_anew) track_log_.AddBegunAnew(id);
    if (!lost_->IsMissing(id)) continue;
    if (lost_->IsInMap(id)) track_log_.AddLost(id);
    track_log_.AddFound(id);
  }
  std::vector<InstanceId> lost = lost_->TakeOut(settled, *map_, tracked.T_WO);
  // Those that the frame shows, but not where they could be registered.
  KeepThoseNotInPlace(frame, association, tracked.T_WO, is_frozen);
  for (const InstanceId id : lost_->TakeOut({}, *map_, tracked.T_WO)) lost.push_back(id);
  if (SaysWhatIsWhere(association.labels)) {
    for (const InstanceId id : lost_->TakeBack(tracked.seen, *map_, tracked.T_WO)) {
      lost.push_back(id);
    }
  }
  for (const InstanceId id : lost) track_log_.AddLost(id);
  lost_->Watch(tracked.seen);
}

void Pipeline::UpdatePoses(int frame, ObjectPoses T_WO) {
  T_WO_ = std::move(T_WO);
  for (const auto& [id, pose] : T_WO_) {
    map_->SetObjectPose(id, pose);
    trajectories_[id][frame] = pose;
  }
}

cv::Mat Pipeline::RepairMasks(const Frame& frame, const TrackedFrame& tracked) {
  if (repair_ == nullptr) return tracked.labels;
  std::set<InstanceId> unplaced;
  for (const auto& [id, pose] : T_WO_) {
    if (config_.poses == PoseSource::kGiven || !tracked_.Contains(id)) continue;
    const auto status = tracked.seen.find(id);
    const bool is_placed =
        status != tracked.seen.end() &&
        (status->second == TrackStatus::kBegun || status->second == TrackStatus::kTracked);
    if (!is_placed) unplaced.insert(id);
  }
  // Pixels have other objects than those of CheckReach(), and objects perhaps other lattices.
  return WithoutBeyond(*map_, frame,
                       repair_->Repair(frame, tracked.labels, T_WO_, unplaced, *map_));
}

void Pipeline::Fuse(const Frame& frame, const cv::Mat& labels) {
  map_->Fuse(frame, labels);
  CountWhileEmpty(frame, labels);
  labels_ = labels.clone();  // of images that whoever gave them may fill again
  farthest_m_ = std::max(farthest_m_, frame.T_WC.translation().cwiseAbs().maxCoeff());
}

void Pipeline::CountWhileEmpty(const Frame& frame, const cv::Mat& labels) {
  if (!is_empty_) return;
  is_empty_ = map_->Memory().blocks == 0;
  if (is_empty_) in_vain_.Add(frame, labels);
}

}  // namespace tsdfpp
