// How far each point of a map is from the truth, and when the camera last saw it: what a report
// colours surfaces by.
#pragma once

#include <vector>

#include "eval/tools/packed_mesh.h"
#include "eval/truth/scene_truth.h"

namespace tsdfpp {

inline constexpr double kErrorStep_m = 0.0002;   // of VertexMeasures::error, which ends at 255
inline constexpr double kAgeSteps = 254;         // of VertexMeasures::age, over all frames
inline constexpr std::uint8_t kNeverSeen = 255;  // as an age

// The number of the tracker of an object; that of all trackers where there is none.
std::size_t TrackerOf(const SceneTruth& truth, InstanceId id);

class SightLog {
 public:
  // Each frame in order, with true depth and camera pose.
  void See(const Frame& true_frame);

  // For each vertex (world frame) of a mesh of object `id`, which the truth has at its current
  // pose: the distance to the object's true surface, and how many of the `frames` lie between now
  // and the last one whose depth agreed with the vertex within `slack_m`, with the object carried
  // back along its true poses.
  VertexMeasures Measure(const TriangleMesh& mesh_W, InstanceId id, const SceneTruth& truth,
                         double slack_m, int frames) const;

 private:
  // Where the camera was and how far it saw, on every fourth pixel of every fourth row.
  struct Sight {
    int frame = 0;
    Intrinsics intrinsics;
    Pose T_WC = Pose::Identity();
    cv::Mat depth;
  };
  std::vector<Sight> sights_;
};

}  // namespace tsdfpp
