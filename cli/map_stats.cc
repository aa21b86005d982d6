#include "cli/map_stats.h"

#include <string>

#include "mapper/kernels.h"

namespace tsdfpp {
namespace {

// What was tracked, from when to when.
nlohmann::json TrackingJson(const MapStart& start) {
  const Pipeline& pipeline = *start.pipeline;
  const std::vector<ObjectInfo> known = ObjectsOf(start);
  nlohmann::json objects = nlohmann::json::array();
  for (const auto& [id, span] : pipeline.track_log().objects()) {
    std::string name;
    for (const ObjectInfo& object : known) {
      if (object.id == id) name = object.name;
    }
    objects.push_back({{"id", id},
                       {"name", name},
                       {"first_frame", span.first},
                       {"last_frame", span.last},
                       {"tracked_frames", span.tracked},
                       {"stayed_frames", span.stayed},
                       {"frozen_frames", span.frozen},
                       {"times_lost", span.lost},
                       {"times_found", span.found},
                       {"times_begun_anew", span.begun_anew}});
    if (span.moved) objects.back()["moved_since_frame"] = *span.moved;
  }
  return {{"which", TrackChoiceName(pipeline.tracked().choice())}, {"objects", objects}};
}

}  // namespace

nlohmann::json StatsOf(const MapStart& start, const RunTimes& times,
                       const std::vector<InstanceId>& removed, const MapMemory& memory) {
  const PipelineConfig& config = start.config;
  nlohmann::json stats{
      {"method", MethodName(config.method)},
      {"camera", CameraSourceName(config.camera)},
      {"poses", PoseSourceName(config.poses)},
      {"segmentation", SegmentationName(config.segmentation)},
      {"bleeding",
       BleedingPixelsName(config.BleedingWaits() ? BleedingPixels::kWait : BleedingPixels::kKeep)},
      {"mask_repair", MaskRepairModeName(config.mask_repair)},
      {"associate", AssociationModeName(config.associate)},
      {"sequence", start.info.name},
      {"frames", start.frames()},
      {"removed", removed},
      {"voxel_m", config.map.voxel_m},
      {"trunc_front_voxels", config.map.trunc_front_voxels},
      {"trunc_back_voxels", config.map.trunc_back_voxels},
      {"layers", LayersOf(config.method, config.map)},
      {"kernels", KernelsName(UsedKernels())},
      {"times", times.ToJson()},
      {"map", {{"blocks", memory.blocks}, {"bytes", memory.bytes}}},
  };
  if (config.poses != PoseSource::kGiven) stats["tracking"] = TrackingJson(start);
  if (config.camera != CameraSource::kGiven) {
    const CameraLog& log = start.pipeline->camera_log();
    stats["camera_frames"] = {
        {"located", log.located}, {"carried_on", log.carried_on}, {"lost", log.lost}};
  }
  if (!start.mask_remark.empty()) stats["remarks"] = {start.mask_remark};
  for (const std::string& remark : start.pipeline->Remarks()) stats["remarks"].push_back(remark);
  return stats;
}

}  // namespace tsdfpp
