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

  // Goes on from a map whose last frame's camera was found there. To be told before the first
  // frame.
  void GoOnFrom(const CameraPlace& place);

  // The frame with T_WC as the map's background says: its pixels that `segments` (CV_16UC1) calls
  // kBackground, or all where it says nothing at all, are registered to it by the terms of
  // SdfTracker, whose gates hold. A frame has the given pose if the map begins with its background;
  // with kRefine also where the map has none yet. Nothing where the camera is lost, which with
  // kTrack it is until there is a background. `map` holds what was fused before the frame. With
  // kGiven the frame is as it was.
  std::optional<Frame> Locate(const Frame& frame, const cv::Mat& segments,
                              const MapRepresentation& map);
  // The frame that was located last is mapped: the log has it from now on.
  void Accept();

  // Empty with kGiven.
  const CameraLog& log() const { return log_; }

  // What to go on from after the frame mapped last; nothing where its pose was taken as given.
  const std::optional<CameraPlace>& place() const { return place_; }

 private:
  CameraSource source_;
  // The camera is taken to be where it is given (kTrack: where it was given at first), and the
  // background to have moved before it.
  Pose T_WB_ = Pose::Identity();
  std::optional<Pose> T_WC_first_;
  SdfTracker tracker_;
  CameraLog log_;
  std::optional<CameraPlace> place_;
  CameraLog located_;  // what the frame located last adds
  std::optional<CameraPlace> place_located_;
};

}  // namespace tsdfpp
