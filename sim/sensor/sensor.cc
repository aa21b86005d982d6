#include "sim/sensor/sensor.h"

#include <utility>

#include "core/pose_text.h"
#include "sim/sensor/colour_noise.h"
#include "sim/sensor/depth_noise.h"
#include "sim/sensor/pose_noise.h"

namespace tsdfpp {
namespace {

Expected<void> CheckMask(const MaskFaultConfig& config, const SequenceInfo& info,
                         const Frame& frame) {
  if (config == MaskFaultConfig{}) return {};
  if (frame.mask.empty()) {
    return UsageError("sensor.masks asks for mask faults, and frame {} of '{}' has no mask",
                      frame.index, info.name);
  }
  const int inventions = InventionsAnObject(config);
  if (inventions == 0) return {};
  int objects = 0;
  for (const ObjectInfo& object : info.objects) {
    if (object.id >= kFirstInventedId) {
      return UsageError(
          "sensor.masks.split and .flicker use the ids from {} on, and object '{}' of '{}' has id "
          "{}: expected ids below {}",
          kFirstInventedId, object.name, info.name, object.id, kFirstInventedId);
    }
    if (object.id != kBackground) ++objects;
  }
  if (objects * inventions > kInventedIds) {
    return UsageError(
        "sensor.masks.split and .flicker may invent {} ids for the {} objects of '{}', expected at "
        "most {}",
        objects * inventions, objects, info.name, kInventedIds);
  }
  return {};
}

}  // namespace

Expected<SensedTruth> ApplySensor(const SensorConfig& config, std::uint64_t seed,
                                  const SequenceInfo& info, Frame& frame) {
  TSDFPP_RETURN_IF_ERROR(ValidateSensorConfig(config));
  TSDFPP_RETURN_IF_ERROR(CheckMask(config.masks, info, frame));
  SensedTruth truth{frame.colour, frame.depth, frame.mask, frame.T_WC, {}};
  TSDFPP_ASSIGN(cv::Mat depth, SenseDepth(config.depth, seed, frame));
  cv::Mat colour = SenseColour(config.colour, seed, frame);
  frame.depth = std::move(depth);
  frame.colour = std::move(colour);
  if (!frame.mask.empty()) {
    SensedMask sensed = SenseMask(config.masks, seed, frame.index, frame.mask, info.objects);
    frame.mask = std::move(sensed.mask);
    truth.segments = std::move(sensed.segments);
  }
  if (config.camera_pose != CameraPoseConfig{}) {
    frame.T_WC = PoseThroughText(
        SenseCameraPose(config.camera_pose, seed, frame.index, info.first_index, frame.T_WC));
  }
  return truth;
}

}  // namespace tsdfpp
