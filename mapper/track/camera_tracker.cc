#include "mapper/track/camera_tracker.h"

#include <algorithm>

#include "mapper/segment/segmenter.h"
#include "mapper/volume/lattice_range.h"

namespace tsdfpp {
namespace {

// The background, as the tracker sees it: an object like any other.
constexpr InstanceId kRoom = 1;

// A room is deeper than an object, and its far side noisy: without a model of the sensor's noise,
// what Nguyen, Izadi and Lovell 2012 measured of Kinect.
constexpr double kAxial_m = 0.0012;
constexpr double kAxialGrowth = 0.0019;
constexpr double kLateral_px = 0.8;
// What the edges of a table say of shifts along it is little, but it is known better than how a
// hand goes on.
constexpr double kWeakShare = 1e-4;
// A camera that turns takes what is far off along by decimetres from frame to frame: a hand's fast
// turn, every fourth frame of it, needs this much.
constexpr double kHuber_voxels = 5;
constexpr double kMaxTranslation_voxels = 60;
constexpr int kMaxIterations = 40;
constexpr int kCoarsePoints = 1500;
// Over a room's radius, several times an object's.
constexpr double kSettled_voxels = 0.02;
// A camera that turns so far has other things in sight.
constexpr double kKeyframeTurn_rad = 0.15;

SdfTrackConfig OfRoom(SdfTrackConfig config, CameraSource source) {
  config.rest_voxels = 0;
  // A room has no outline, and fills the picture.
  config.free_space_weight = config.outline_weight = config.colour_weight = 0;
  // What stands in a room hides it.
  config.min_shown_share = 0;
  // Its floor is seen at grazing angles, and has no other side.
  config.max_slope = config.certain_slope = 0;
  config.keyframe_turn_rad = std::min(config.keyframe_turn_rad, kKeyframeTurn_rad);
  config.anchor_turn_rad = config.rest_turn_rad = 0;
  // Where a camera was is no reason to think that it is there still; a given pose is one, each
  // frame's own.
  config.rest_frames = 0;
  config.rest_trend = 0;
  if (source == CameraSource::kTrack) config.rest_evidence = 0;
  config.settled_voxels = std::max(config.settled_voxels, kSettled_voxels);
  config.huber_voxels = std::max(config.huber_voxels, kHuber_voxels);
  config.max_translation_voxels = std::max(config.max_translation_voxels, kMaxTranslation_voxels);
  config.max_iterations = std::max(config.max_iterations, kMaxIterations);
  config.coarse_points = std::max(config.coarse_points, kCoarsePoints);
  config.weak_share = std::min(config.weak_share, kWeakShare);
  if (config.axial_m == 0 && config.axial_growth == 0 && config.lateral_px == 0) {
    config.axial_m = kAxial_m;
    config.axial_growth = kAxialGrowth;
    config.lateral_px = kLateral_px;
  }
  return config;
}

// kRoom where the segments say kBackground, else kNoInstance; where they say nothing at all, it is
// the most of the picture.
cv::Mat RoomOf(const cv::Mat& segments) {
  if (!SaysWhatIsWhere(segments)) return {segments.size(), CV_16UC1, cv::Scalar(kRoom)};
  cv::Mat room(segments.size(), CV_16UC1, cv::Scalar(kNoInstance));
  room.setTo(kRoom, segments == static_cast<double>(kBackground));
  return room;
}

}  // namespace

CameraTracker::CameraTracker(CameraSource source, const SdfTrackConfig& config)
    : source_(source),
      tracker_(OfRoom(config, source),
               [this](const MapRepresentation& map, InstanceId) -> std::optional<ObjectModel> {
                 auto model = ModelOf(map, kBackground);
                 if (model) model->T_WL = T_WB_;
                 return model;
               }) {}

void CameraTracker::GoOnFrom(const CameraPlace& place) {
  place_ = place;
  T_WC_first_ = place.T_WC_given;
  T_WB_ = MadeRigid(place.T_WC_given * place.T_WC.inverse());
}

std::optional<Frame> CameraTracker::Locate(const Frame& frame, const cv::Mat& segments,
                                           const MapRepresentation& map) {
  located_ = {};
  place_located_.reset();
  if (source_ == CameraSource::kGiven) return frame;
  const bool begins = !ModelOf(map, kBackground);
  if (begins || !T_WC_first_) T_WC_first_ = frame.T_WC;
  if (begins) T_WB_ = Pose::Identity();
  Frame assumed = frame;
  if (source_ == CameraSource::kTrack) assumed.T_WC = *T_WC_first_;
  ObjectPoses before;
  if (!begins) before[kRoom] = T_WB_;
  const TrackedPoses after = tracker_.Track(assumed, RoomOf(segments), map, before);
  const auto status = after.seen.find(kRoom);
  if (status != after.seen.end() && status->second == TrackStatus::kTracked) {
    T_WB_ = after.T_WO.at(kRoom);
    ++located_.located;
  } else if (!begins || status == after.seen.end() || status->second != TrackStatus::kBegun) {
    // There is no room in sight, or it is not found.
    if (source_ == CameraSource::kTrack) {
      ++log_.lost;
      return std::nullopt;
    }
    ++located_.carried_on;
  }
  assumed.T_WC = T_WB_.inverse() * assumed.T_WC;
  located_.T_WC[frame.index] = assumed.T_WC;
  const bool is_corrected = source_ == CameraSource::kRefine;
  place_located_ = CameraPlace{is_corrected ? frame.T_WC : assumed.T_WC, assumed.T_WC};
  return assumed;
}

void CameraTracker::Accept() {
  for (const auto& [index, T_WC] : located_.T_WC) log_.T_WC[index] = T_WC;
  log_.located += located_.located;
  log_.carried_on += located_.carried_on;
  located_ = {};
  place_ = place_located_;
}

}  // namespace tsdfpp
