// Things broken on purpose, one at a time, to see that a gate notices (docs/gates.md).
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/frame_source.h"
#include "eval/score/evaluation.h"
#include "eval/truth/scene_truth.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

enum class Sabotage {
  kNone,
  // What the mapper is given; what it is scored against stays true.
  kObjectPose,      // from one third of the sequence on, poses of the moving objects are 5 mm off
  kFrozenObject,    // objects keep the pose of the first frame
  kObjectLate,      // poses of the moving objects are those of one recorded frame before
  kStalePose,       // the middle frame has the poses, camera's too, of the frame before
  kMasksSwapped,    // two objects have each other's mask
  kMaskDilated,     // a moving object's mask is a pixel larger all around
  kPrincipalPoint,  // off by one pixel
  kDepthScale,      // depth times 1.005
  // The map.
  kTruncationHalved,
  kContradictionOff,
  kNearestResampling,
  kRimsOff,
  // What is scored.
  kInactiveDropped,  // a removal uncovers nothing: the visible scene less the removed faces
  kLabelsPermuted,   // the ids of the meshes' faces
  // The scoring.
  kTruthShifted,  // the true surfaces are one voxel higher
  kVisibleOnly,   // only surface that the last frames saw is sampled
};

// All but kNone.
const std::vector<Sabotage>& Sabotages();
// "object-pose", "none".
std::string_view SabotageName(Sabotage sabotage);
// A clause: "object poses are 5 mm off from one third of the sequence on".
std::string_view SabotageWords(Sabotage sabotage);
// Errors: kUsage, a clause such as "is 'x', expected one of ...".
Expected<Sabotage> SabotageFromName(std::string_view name);
inline Expected<void> CheckSabotageName(std::string_view name) {
  return SabotageFromName(name).map([](Sabotage) {});
}
// Whether frames or truth differ by it, so that a sequence has to be made for it alone.
bool IsOfSequence(Sabotage sabotage);
// Whether frames, map and truth are the same with it and without: only how the map is looked at
// differs.
bool IsOfScoring(Sabotage sabotage);

inline constexpr double kObjectPoseShift_m = 0.005;
inline constexpr double kDepthScaleFactor = 1.005;

// Breaks what a mapper is given. `frames` are the sequence's used ones.
class FrameSabotage {
 public:
  FrameSabotage(Sabotage sabotage, std::vector<int> frames)
      : sabotage_(sabotage), frames_(std::move(frames)) {}

  // Must come before `source` reads frame `index` for the mapper: reads what else is needed.
  // Errors: the source's; kUsage where masks cannot be swapped.
  Expected<void> Prepare(FrameSource& source, int index);
  // Changes poses, images (copies of them) and intrinsics of the frame.
  void Apply(const SequenceInfo& info, Frame& frame) const;

 private:
  Sabotage sabotage_;
  std::vector<int> frames_;
  std::map<InstanceId, Pose> first_T_WO_;
  std::optional<Frame> stale_;  // the frame before the middle one
  // kObjectLate: of the recorded frame before the one that comes.
  std::map<InstanceId, Pose> late_T_WO_;
};

// Breaks the map's settings.
void SabotageMap(Sabotage sabotage, PipelineConfig& config);
// Breaks the meshes that an evaluation looks at.
void SabotageMeshes(Sabotage sabotage, SceneMeshes& meshes);
// The truth of the source, with the true surfaces shifted where that is the sabotage. Errors: those
// of SceneTruth::Create.
Expected<SceneTruth> SabotagedTruth(Sabotage sabotage, FrameSource& source, double voxel_m);
// kVisibleOnly: the truth that only knows of `recent` frames. Errors: those of SceneTruth.
Expected<SceneTruth> TruthOfRecentFrames(FrameSource& source, const std::deque<Frame>& recent);

}  // namespace tsdfpp
