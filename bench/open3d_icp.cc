#include "bench/open3d_icp.h"

#include <open3d/geometry/KDTreeSearchParam.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/pipelines/registration/Registration.h>
#include <open3d/pipelines/registration/RobustKernel.h>
#include <open3d/pipelines/registration/TransformationEstimation.h>

#include <memory>

#include "core/pixel_ray.h"
namespace tsdfpp {
namespace {

namespace o3r = open3d::pipelines::registration;
using open3d::geometry::KDTreeSearchParamHybrid;
using open3d::geometry::PointCloud;

constexpr double kThin_m = 0.01;
constexpr double kNormals_m = 0.04;
constexpr int kNormalPoints = 30;
constexpr int kIterations = 60;

std::shared_ptr<PointCloud> CloudOf(const Frame& frame) {
  PointCloud cloud;
  const Intrinsics& k = frame.intrinsics;
  for (int v = 0; v < frame.depth.rows; ++v) {
    const auto* row = frame.depth.ptr<float>(v);
    for (int u = 0; u < frame.depth.cols; ++u) {
      const double z = row[u];
      if (z > 0) cloud.points_.emplace_back(z * PixelRay(k, u, v));
    }
  }
  auto thin = cloud.VoxelDownSample(kThin_m);
  thin->EstimateNormals(KDTreeSearchParamHybrid(kNormals_m, kNormalPoints));
  return thin;
}

}  // namespace

Pose MotionByOpen3dIcp(const Frame& before, const Frame& after, const Pose& T_guess) {
  const auto target = CloudOf(before);
  const auto source = CloudOf(after);
  if (target->IsEmpty() || source->IsEmpty()) return T_guess;
  Eigen::Matrix4d T = T_guess.matrix();
  for (const double reach_m : {0.07, 0.025}) {
    const o3r::TransformationEstimationPointToPlane estimation(
        std::make_shared<o3r::TukeyLoss>(reach_m));
    T = o3r::RegistrationICP(*source, *target, reach_m, T, estimation,
                             o3r::ICPConvergenceCriteria(1e-7, 1e-7, kIterations))
            .transformation_;
  }
  return Pose(T);
}

}  // namespace tsdfpp
