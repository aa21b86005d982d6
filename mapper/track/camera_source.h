// Where camera poses come from, and what became of the camera.
#pragma once

#include <map>
#include <string_view>

#include "core/error.h"
#include "core/types.h"
#include "mapper/method_info.h"

namespace tsdfpp {

enum class CameraSource {
  kGiven,   // Frame::T_WC, the paper's setting
  kRefine,  // the same, corrected by the map's background
  kTrack,   // that of the first frame, and from then on by the background alone
};

// "gt", "refine" or "track". Errors: kUsage.
Expected<CameraSource> CameraSourceFromName(std::string_view name);
std::string_view CameraSourceName(CameraSource source);

// Errors: kUsage, a sentence, where the method's maps have not what the camera is tracked by.
Expected<void> CheckCamera(Method method, CameraSource source);

// What became of the camera, frame by frame.
struct CameraLog {
  std::map<int, Pose> T_WC;  // as mapped, by frame; not of those that were lost
  int located = 0;           // frames registered to the background
  int carried_on = 0;        // kRefine, not registered: the given motion since the last was taken
  int lost = 0;              // kTrack, not registered: not mapped
};

// Where the camera of the frame that was mapped last was given (kTrack, which does not look at it:
// found), and where it was found.
struct CameraPlace {
  Pose T_WC_given = Pose::Identity();
  Pose T_WC = Pose::Identity();
};

}  // namespace tsdfpp
