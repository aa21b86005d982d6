// An oracle for rendered images that shares no code with the renderer: MuJoCo's own rays, cast at
// the true surfaces in double precision.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// What the rays of all pixels hit, row by row. A ray that hits nothing has id kNoInstance and an
// infinite depth.
struct RayImage {
  Intrinsics intrinsics;
  std::vector<double> depth;  // metres along the optical axis
  std::vector<InstanceId> id;
  std::vector<Eigen::Vector3d> normal_C;  // unit, in the camera's frame
};

// The true surfaces as a scene of their own. Copies share the model; each has a state of its own,
// so that threads can cast rays of different frames.
class RayScene {
 public:
  // One mesh an object; the background (id kBackground) stands still. Errors: kEnvironment where
  // MuJoCo refuses a mesh, with its words.
  static Expected<RayScene> Compose(const std::vector<TrueModel>& models);

  RayScene(const RayScene& other);
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(const RayScene&) = delete;
  ~RayScene();

  // The ray of every pixel from T_WC with the objects at T_WO. An object without a pose is not in
  // the picture. Rays end at 100 m (kMaxValidDepth_m).
  RayImage Cast(const Intrinsics& intrinsics, const Pose& T_WC,
                const std::map<InstanceId, Pose>& T_WO);

 private:
  struct Model;
  struct State;
  RayScene(std::shared_ptr<const Model> model, std::unique_ptr<State> state);
  std::shared_ptr<const Model> model_;
  std::unique_ptr<State> state_;
};

// Which pixels a rasteriser and a ray must agree on.
struct RayCheckConfig {
  // Beyond this angle between ray and normal a shift of 1/256 pixel, the rasteriser's grid for
  // vertices, moves the depth by more than a tenth of a millimetre.
  double max_incidence_deg = 80;
  // A pixel is on an edge if one of its eight neighbours shows another instance, or a depth that
  // leaves the pixel's tangent plane by more than this.
  double edge_step_m = 2e-3;
  // It also is if a neighbour is farther from the tangent plane than by this and by as much as a
  // bend of the surface between the two can make: a low step, as of a card on a card.
  double low_step_m = 5e-5;
};

// Is the pixel on an edge of the ray image?
bool IsOnEdge(const RayImage& rays, int u, int v, const RayCheckConfig& config = {});

// Of a rendered image beside the rays': a pixel's state and by how much its depth is off.
enum class RayVerdict { kExcluded, kMissed, kWrongId, kCompared };
struct PixelComparison {
  RayVerdict verdict = RayVerdict::kExcluded;
  double depth_error_m = 0;  // absolute, where kCompared
};
// kMissed: exactly one of ray and image hits something. Excluded: on an edge, at grazing incidence,
// or neither hits anything.
PixelComparison ComparePixel(const RayImage& rays, const cv::Mat& depth, const cv::Mat& mask, int u,
                             int v, const RayCheckConfig& config = {});

}  // namespace tsdfpp
