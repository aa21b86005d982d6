// One frame through the whole simulated sensor.
#pragma once

#include <cstdint>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"
#include "sim/config/sensor_config.h"
#include "sim/sensor/mask_faults.h"

namespace tsdfpp {

// The truth that the sensor hid, and what its mask's ids stand for.
struct SensedTruth {
  cv::Mat colour;
  cv::Mat depth;
  cv::Mat mask;
  Pose T_WC = Pose::Identity();
  std::vector<MaskSegment> segments;  // of the sensed mask; none where the frame has no mask
};

// Replaces the frame's colour, depth, mask and camera pose by what the sensor gives, and returns
// what they were (images are shared, not copied). Depth and colour are sensed of the true images,
// the pose is taken through text (core/pose_text.h) where it changed, T_WO stays true. The shutter
// is not applied here: it comes before, from several renders (sim/render/shutter.h). The result
// depends on `config`, `seed`, the true frame, and of `info` on first_index (where drift begins)
// and the objects' classes alone: not on frames sensed before. The exact config changes no byte.
// Errors: kUsage where the config is invalid (ValidateSensorConfig), where it needs an image that
// the frame lacks (colour for the depth model azure, a mask for mask faults), or where it invents
// ids and an object's id is kFirstInventedId or more, or the objects are more than there are ids to
// invent for.
Expected<SensedTruth> ApplySensor(const SensorConfig& config, std::uint64_t seed,
                                  const SequenceInfo& info, Frame& frame);

}  // namespace tsdfpp
