// Where the camera is when it takes a frame, by what stands still: for recordings whose camera
// poses are off, or are not there (docs/tracking.md, "The camera").
#pragma once

#include <optional>

#include "mapper/track/camera_source.h"
#include "mapper/track/sdf_tracker.h"

namespace tsdfpp {

class CameraTracker {
 public:
  // The config must be valid. What differs between a room and an object is not taken from it, or
  // only where it goes further: OfRoom() in camera_tracker.cc.
  CameraTracker(CameraSource source, const SdfTrackConfig& config);
  CameraTracker(const CameraTracker&) = delete;
  CameraTracker& operator=(const CameraTracker&) = delete;

  // The frame with T_WC as the map's background says: its pixels that `segments` (CV_16UC1) calls
  // kBackground, or all where it says nothing at all, are registered to it by the terms of
  // SdfTracker, whose gates hold. Frames have the given pose until the map has a background.
  // Nothing where the camera is lost. `map` holds what was fused before the frame. With kGiven the
  // frame is as it was.
  std::optional<Frame> Locate(const Frame& frame, const cv::Mat& segments,
                              const MapRepresentation& map);

  // Empty with kGiven.
  const CameraLog& log() const { return log_; }

 private:
  CameraSource source_;
  // The camera is taken to be where it is given (kTrack: where it was given at first), and the
  // background to have moved before it.
  Pose T_WB_ = Pose::Identity();
  std::optional<Pose> T_WC_first_;
  SdfTracker tracker_;
  CameraLog log_;
};

}  // namespace tsdfpp
