#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "eval/compare/compare.h"
#include "eval/run/compare_names.h"

namespace tsdfpp {

bool IdsAreObjects(const CompareConfig& config, const SequenceInfo& info) {
  return info.mask_ids_are_objects && !IdsAreOfOneFrame(config.segmentation);
}

AssociationMode AssociationOf(const CompareConfig& config, const SequenceInfo& info) {
  return config.associate.value_or(IdsAreObjects(config, info) ? AssociationMode::kGiven
                                                               : AssociationMode::kVotes);
}

CompareRun::CompareRun(const PipelineConfig& pipeline_config, std::string profile_name,
                       const std::vector<ObjectInfo>& objects, const SceneTruth& truth)
    : config(pipeline_config),
      profile(std::move(profile_name)),
      pipeline(config, objects),
      last_seen(MakeLastSeenStores(truth)) {}

void CompareRun::TakeNotes() {
  memory.push_back(pipeline.map().Memory());
  notes = {times, pipeline.camera_log(), pipeline.trajectories(), nullptr, process_growth_bytes};
  if (config.associate == AssociationMode::kVotes) notes.matched_ids = matching.ToJson();
}

std::string CompareRun::Title() const {
  std::string_view segments;
  if (config.segmentation == Segmentation::kDepth) segments = ", segments of depth";
  if (config.segmentation == Segmentation::kNetwork) segments = ", segments of a network";
  if (config.segmentation == Segmentation::kFull) segments = ", segments of depth and a network";
  return fmt::format("{}, {}, {}{}{}", MethodName(config.method), profile,
                     PoseSourceTitle(config.poses), segments,
                     config.associate == AssociationMode::kVotes ? ", ids by votes" : "");
}

std::string CompareRun::FolderName() const {
  return RunFolderName(config.method, profile, config.poses);
}

}  // namespace tsdfpp
