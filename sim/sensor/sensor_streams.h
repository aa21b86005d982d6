// The streams of random numbers (core/random.h) that the sensor models draw from, one a purpose, so
// that switching one fault on changes no draw of another.
#pragma once

#include <cstdint>

namespace tsdfpp {

enum SensorStream : std::uint32_t {
  kStreamDepthModel = 1000,
  kStreamDotPattern = 1002,
  kStreamFlyingPixels = 1003,
  kStreamDropOut = 1004,
  kStreamShotNoise = 1010,
  kStreamLevelNoise = 1011,
  kStreamExposure = 1012,
  kStreamPoseDriftTranslation = 1020,
  kStreamPoseDriftRotation = 1021,
  kStreamPoseJitterTranslation = 1022,
  kStreamPoseJitterRotation = 1023,
  kStreamMaskMissing = 1030,
  kStreamMaskUndershoot = 1031,
  kStreamMaskBleed = 1032,
  kStreamMaskSplit = 1033,
  kStreamMaskMerged = 1034,
  kStreamMaskFlicker = 1035,
  kStreamMaskWrongClass = 1036,
};

}  // namespace tsdfpp
