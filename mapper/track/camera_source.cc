#include "mapper/track/camera_source.h"

#include <cstdlib>

namespace tsdfpp {

Expected<CameraSource> CameraSourceFromName(std::string_view name) {
  if (name == "gt") return CameraSource::kGiven;
  if (name == "refine") return CameraSource::kRefine;
  if (name == "track") return CameraSource::kTrack;
  return UsageError("camera source '{}' is unknown, expected gt, refine or track", name);
}

std::string_view CameraSourceName(CameraSource source) {
  switch (source) {
    case CameraSource::kGiven:
      return "gt";
    case CameraSource::kRefine:
      return "refine";
    case CameraSource::kTrack:
      return "track";
  }
  std::abort();
}

Expected<void> CheckCamera(Method method, CameraSource source) {
  if (source == CameraSource::kGiven || InfoOf(method).has_voxels) return {};
  return UsageError(
      "the camera ({}) is found by signed distances, which method '{}' has not, expected gt",
      CameraSourceName(source), MethodName(method));
}

}  // namespace tsdfpp
