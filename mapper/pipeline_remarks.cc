// What a pipeline says of a run that its user should know, and of its objects.
#include <algorithm>
#include <limits>
#include <set>

#include "mapper/pipeline.h"
#include "mapper/track/camera_tracker.h"
#include "mapper/track/lost_objects.h"

namespace tsdfpp {
namespace {

// Voxels from the origin beyond which a coordinate in single precision is off by more than a
// sixteenth of one.
constexpr double kExactVoxels = 1 << 20;

}  // namespace

std::vector<std::string> Pipeline::Remarks() const {
  std::vector<std::string> remarks;
  if (is_empty_) remarks.push_back("the map is empty: " + in_vain_.Text());
  const double voxels = farthest_m_ / config_.map.voxel_m;
  if (voxels > kExactVoxels) {
    remarks.push_back(fmt::format(
        "the camera is up to {:.6g} m from the origin along an axis, where single precision rounds "
        "by up to {:.2g} voxels, which blurs surfaces; poses nearer to the origin would help",
        farthest_m_, voxels * std::numeric_limits<float>::epsilon() / 2));
  }
  if (config_.poses != PoseSource::kGiven && track_log_.frames() > 0 && track_log_.IsEmpty()) {
    const std::size_t seen = track_log_.objects().size();
    const std::string_view which =
        tracked_.choice() == TrackChoice::kClassified ? "with a class" : "beside the background";
    remarks.push_back(fmt::format(
        "objects were to be tracked (--poses {}) and none was: {}", PoseSourceName(config_.poses),
        seen == 0 ? fmt::format("no frame shows an object {}", which)
                  : fmt::format("frames show {} object{} {}, and none could be registered", seen,
                                seen == 1 ? "" : "s", which)));
  }
  if (lost_ != nullptr && !lost_->empty()) {
    std::vector<std::string> names;
    for (const ObjectInfo& object : Objects()) {
      if (lost_->Has(object.id)) names.push_back(object.name);
    }
    remarks.push_back(fmt::format(
        "where {} of the tracked objects went is not known, so the map has nothing of them: {}",
        lost_->Ids().size(), fmt::join(names, ", ")));
  }
  const CameraLog& camera = camera_->log();
  if (camera.lost > 0 || camera.carried_on > 0) {
    remarks.push_back(fmt::format(
        "the camera was not found in {} of {} frames, which are {} (--camera {})",
        camera.lost + camera.carried_on, camera.lost + camera.carried_on + camera.located,
        config_.camera == CameraSource::kTrack ? "not mapped"
                                               : "mapped by its given motion since the last",
        CameraSourceName(config_.camera)));
  }
  for (std::string& remark : associator_->Remarks()) remarks.push_back(std::move(remark));
  return remarks;
}

std::vector<ObjectInfo> Pipeline::Objects() const {
  std::vector<ObjectInfo> objects = objects_;
  const bool votes = config_.associate == AssociationMode::kVotes;
  std::set<InstanceId> ids;
  std::set<std::string> names;
  for (const ObjectInfo& object : objects) {
    ids.insert(object.id);
    names.insert(object.name);
  }
  if (votes && ids.insert(kBackground).second) {
    objects.push_back({kBackground, NameOfUnlisted(kBackground), ""});
  }
  std::set<InstanceId> others;
  for (const InstanceId id : map_->Objects()) others.insert(id);
  for (const auto& [id, poses] : trajectories_) others.insert(id);
  for (const InstanceId id : others) {
    if (!ids.insert(id).second) continue;
    std::string name = NameOfUnlisted(id);
    while (!names.insert(name).second) name += "_";
    objects.push_back({id, name, ""});
  }
  if (!votes) return objects;
  std::sort(objects.begin(), objects.end(),
            [](const ObjectInfo& a, const ObjectInfo& b) { return a.id < b.id; });
  for (ObjectInfo& object : objects) {
    if (object.id != kBackground) object.semantic_class = tracked_.ClassOf(object.id);
  }
  return objects;
}

}  // namespace tsdfpp
