// The faults of an instance-segmentation network, made from a frame's true mask. Nothing else of
// the scene is seen, and every draw is keyed, so a frame's mask can be made again alone.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"
#include "sim/config/sensor_config.h"
#include "sim/sensor/sensor_streams.h"

namespace tsdfpp {

// Ids that the faults invent, for split and flickering instances, are kFirstInventedId to
// kLastInventedId, which still fit 8-bit mask files; true ids stay below.
inline constexpr InstanceId kFirstInventedId = 128;
inline constexpr InstanceId kLastInventedId = 255;
inline constexpr int kInventedIds = kLastInventedId - kFirstInventedId + 1;
// The most ids that the faults may invent for one object in one frame.
int InventionsAnObject(const MaskFaultConfig& config);
// Whether each object has an invented id in every frame, so that ids say nothing of objects.
bool DrawsEveryId(const MaskFaultConfig& config);

// What one id of a sensed mask stands for.
struct MaskSegment {
  InstanceId id = kBackground;      // in the sensed mask
  InstanceId object = kBackground;  // the object it was made of (the lowest id of merged ones)
  std::string semantic_class;       // as the network names it; empty where unknown
  bool operator==(const MaskSegment&) const = default;
};

struct SensedMask {
  cv::Mat mask;                       // CV_16UC1
  std::vector<MaskSegment> segments;  // of the ids in `mask` apart from 0, by id
};

// The frame in which this object's present fault of this kind began, the latest of several; none
// where it has none now. In each frame a fault begins with probability 1 - (1 - rate)^(1 / frames),
// drawn for (seed, stream, frame, object), and lasts `frames` frames: the share of frames with the
// fault is `rate`.
std::optional<int> FaultStart(const FaultTiming& timing, std::uint64_t seed, SensorStream stream,
                              int frame, InstanceId object);

// The steps, each an image of its own; distances are Euclidean, between pixel centres, and beyond
// the image's border nothing is known, so nothing changes because of it.
// Pixels of `objects` with another id within `pixels` become background.
cv::Mat ShrinkMasks(const cv::Mat& mask, const std::vector<InstanceId>& objects, int pixels);
// Pixels within `pixels` of one of `objects` take its id, the nearest one's (the lowest id of
// equally near ones), but not those of another one of `objects`.
cv::Mat GrowMasks(const cv::Mat& mask, const std::vector<InstanceId>& objects, int pixels);
// Pixels of `object` on one side of the line through their centroid at `angle` radians (from +u
// towards +v) take `part`. Nothing where one side would be empty.
cv::Mat SplitMask(const cv::Mat& mask, InstanceId object, double angle, InstanceId part);
// The one of `others` (sorted) most pixels of which lie within `pixels` of `object` (the lowest id
// of several); kNoInstance where none does.
InstanceId TouchingObject(const cv::Mat& mask, InstanceId object, int pixels,
                          std::span<const InstanceId> others);

// `mask` is CV_16UC1; `objects` gives the classes. Where ids are invented, those of the mask are
// below kFirstInventedId and so few that kInventedIds are enough; aborts where these are used up.
// The exact config changes no pixel.
SensedMask SenseMask(const MaskFaultConfig& config, std::uint64_t seed, int frame,
                     const cv::Mat& mask, const std::vector<ObjectInfo>& objects);

}  // namespace tsdfpp
