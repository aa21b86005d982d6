#include "mapper/track/icp_registration.h"

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/registration/icp.h>
#include <pcl/registration/transformation_estimation_point_to_plane.h>
#include <pcl/search/kdtree.h>

#include <algorithm>
#include <cmath>

#include "core/pixel_ray.h"
#include "core/setting_order.h"
namespace tsdfpp {
namespace {

using Point = pcl::PointNormal;  // a segment's points have no normal, but PCL takes one type
using Cloud = pcl::PointCloud<Point>;
using Tree = pcl::search::KdTree<Point>;
using PointToPlaneLm =
    pcl::registration::TransformationEstimationPointToPlane<Point, Point, double>;

// The plain class, because IterativeClosestPointWithNormals only adds linear least squares to it,
// which its constructor and setUseSymmetricObjective install in place of any other estimator.
// In double, because the estimator differentiates numerically.
class Icp : public pcl::IterativeClosestPoint<Point, Point, double> {
 public:
  Icp() { setTransformationEstimation(pcl::make_shared<PointToPlaneLm>()); }
  int iterations() const { return nr_iterations_; }
};

Expected<void> InRange(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("tracking setting '{}' is {}, expected {} to {}", field, value, lowest,
                    highest);
}

// Vertices, less `origin`, with normals; those that no face gives a normal are left out.
Cloud::Ptr MakeModel(const TriangleMesh& mesh, const Eigen::Vector3d& origin) {
  std::vector<Eigen::Vector3d> normals(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d p = mesh.vertices[a].cast<double>();
    // Its length is twice the area, which is the weight.
    const Eigen::Vector3d normal =
        (mesh.vertices[b].cast<double>() - p).cross(mesh.vertices[c].cast<double>() - p);
    for (const std::uint32_t corner : {a, b, c}) normals[corner] += normal;
  }
  auto model = pcl::make_shared<Cloud>();
  model->reserve(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const double length = normals[i].norm();
    const Eigen::Vector3d p = mesh.vertices[i].cast<double>() - origin;
    if (!p.allFinite() || !std::isfinite(length) || length <= 0) continue;
    Point point;
    point.getVector3fMap() = p.cast<float>();
    point.getNormalVector3fMap() = (normals[i] / length).cast<float>();
    model->push_back(point);
  }
  return model;
}

struct Matches {
  int count = 0;
  double rmse_m = 0;
};

// The segment's points that, moved by T, have a vertex within the limit.
Matches FindMatches(const Cloud& segment, const Cloud& model, const Tree& tree, const Pose& T,
                    double limit_m) {
  Matches matches;
  double sum = 0;
  pcl::Indices nearest(1);
  std::vector<float> squared_distance(1);
  for (const Point& point : segment) {
    const Eigen::Vector3d p = T * point.getVector3fMap().cast<double>();
    Point query;
    query.getVector3fMap() = p.cast<float>();
    if (tree.nearestKSearch(query, 1, nearest, squared_distance) != 1) continue;
    if (squared_distance[0] > limit_m * limit_m) continue;
    const Point& vertex = model[static_cast<std::size_t>(nearest[0])];
    const double distance = (p - vertex.getVector3fMap().cast<double>())
                                .dot(vertex.getNormalVector3fMap().cast<double>());
    sum += distance * distance;
    ++matches.count;
  }
  if (matches.count > 0) matches.rmse_m = std::sqrt(sum / matches.count);
  return matches;
}

// PCL's points are floats, so they are taken from the segment's centroid, S.
struct CentredSegment {
  Eigen::Vector3d centroid_W = Eigen::Vector3d::Zero();
  Cloud::Ptr points_S = pcl::make_shared<Cloud>();
  double radius_m = 0;
};

// Without points where one of them, or the centroid, is no number: PCL aborts there.
CentredSegment Centre(const std::vector<Eigen::Vector3d>& segment_W) {
  CentredSegment segment;
  for (const Eigen::Vector3d& p_W : segment_W) segment.centroid_W += p_W;
  segment.centroid_W /= static_cast<double>(segment_W.size());
  if (!segment.centroid_W.allFinite()) return segment;
  segment.points_S->reserve(segment_W.size());
  for (const Eigen::Vector3d& p_W : segment_W) {
    const Eigen::Vector3d p_S = p_W - segment.centroid_W;
    if (!p_S.cast<float>().allFinite()) return {};
    segment.radius_m = std::max(segment.radius_m, p_S.norm());
    Point point;
    point.getVector3fMap() = p_S.cast<float>();
    segment.points_S->push_back(point);
  }
  return segment;
}

void SetUp(Icp& icp, const IcpConfig& config, double voxel_m, double radius_m) {
  icp.setMaxCorrespondenceDistance(config.correspondence_voxels * voxel_m);
  icp.setMaximumIterations(config.max_iterations);
  // PCL takes the square of a length and the cosine of an angle; half of the step for each.
  const double step_m = 0.5 * config.settled_voxels * voxel_m;
  icp.setTransformationEpsilon(step_m * step_m);
  icp.setTransformationRotationEpsilon(std::cos(std::min(step_m / radius_m, 1.0)));
  // Else PCL reports ICP that ran out of iterations as converged, or stops where the error, but not
  // the motion, is at rest.
  icp.getConvergeCriteria()->setFailureAfterMaximumIterations(true);
  icp.getConvergeCriteria()->setAbsoluteMSE(0);
}

// Of a motion: whether it is one that the config believes.
bool IsWithin(const Eigen::Vector3d& shift, const Eigen::Quaterniond& turn, const IcpConfig& config,
              double voxel_m) {
  return shift.norm() <= config.max_translation_voxels * voxel_m &&
         turn.angularDistance(Eigen::Quaterniond::Identity()) <= config.max_rotation_rad;
}

}  // namespace

Expected<void> IcpConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(InRange("correspondence_voxels", correspondence_voxels, 0.1, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("max_iterations", max_iterations, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("settled_voxels", settled_voxels, 1e-6, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("mask_erosion_px", mask_erosion_px, 0, 50));
  TSDFPP_RETURN_IF_ERROR(InRange("max_points", max_points, 10, 1000000));
  TSDFPP_RETURN_IF_ERROR(InRange("min_points", min_points, 6, 1000000));
  TSDFPP_RETURN_IF_ERROR(
      CheckOrder("tracking", "min_points", min_points, "max_points", max_points));
  TSDFPP_RETURN_IF_ERROR(InRange("min_inlier_share", min_inlier_share, 0, 1));
  TSDFPP_RETURN_IF_ERROR(InRange("max_translation_voxels", max_translation_voxels, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(InRange("max_rotation_rad", max_rotation_rad, 0, EIGEN_PI));
  return {};
}

Expected<IcpConfig> IcpConfig::FromToml(const toml::table& table, const std::string& where) {
  IcpConfig config;
  TomlReader reader(table, where);
  reader.Get("correspondence_voxels", config.correspondence_voxels)
      .Get("max_iterations", config.max_iterations)
      .Get("settled_voxels", config.settled_voxels)
      .Get("mask_erosion_px", config.mask_erosion_px)
      .Get("max_points", config.max_points)
      .Get("min_points", config.min_points)
      .Get("min_inlier_share", config.min_inlier_share)
      .Get("max_translation_voxels", config.max_translation_voxels)
      .Get("max_rotation_rad", config.max_rotation_rad);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table IcpConfig::ToToml() const {
  return toml::table{{"correspondence_voxels", correspondence_voxels},
                     {"max_iterations", max_iterations},
                     {"settled_voxels", settled_voxels},
                     {"mask_erosion_px", mask_erosion_px},
                     {"max_points", max_points},
                     {"min_points", min_points},
                     {"min_inlier_share", min_inlier_share},
                     {"max_translation_voxels", max_translation_voxels},
                     {"max_rotation_rad", max_rotation_rad}};
}

std::vector<Eigen::Vector3d> SegmentPoints(const Frame& frame, const std::vector<int>& pixels,
                                           const IcpConfig& config) {
  std::vector<int> valid;
  valid.reserve(pixels.size());
  const int cols = frame.depth.cols;
  for (const int pixel : pixels) {
    if (IsValidDepth(frame.depth.at<float>(pixel / cols, pixel % cols))) valid.push_back(pixel);
  }
  const std::size_t count = std::min(valid.size(), static_cast<std::size_t>(config.max_points));
  const Intrinsics& camera = frame.intrinsics;
  std::vector<Eigen::Vector3d> points_W;
  points_W.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const int at = valid[i * valid.size() / count];
    const cv::Point pixel(at % cols, at / cols);
    const double z = frame.depth.at<float>(pixel);
    const Eigen::Vector3d p_C = z * PixelRay(camera, pixel.x, pixel.y);
    points_W.emplace_back(frame.T_WC * p_C);
  }
  return points_W;
}

TrackResult TrackObject(const std::vector<Eigen::Vector3d>& segment_W, const TriangleMesh& model_W,
                        double voxel_m, const IcpConfig& config) {
  TrackResult result;
  const auto too_few = [&](std::size_t count) {
    return count < static_cast<std::size_t>(config.min_points);
  };
  if (too_few(segment_W.size())) return result;

  const CentredSegment segment = Centre(segment_W);
  if (segment.points_S->empty()) return result;
  const Cloud::Ptr model_S = MakeModel(model_W, segment.centroid_W);
  // A segment smaller than a voxel says nothing about a rotation.
  if (too_few(model_S->size()) || segment.radius_m < voxel_m) return result;
  const auto tree = pcl::make_shared<Tree>();
  tree->setInputCloud(model_S);
  const auto note_matches = [&](const Pose& T) {
    const Matches matches =
        FindMatches(*segment.points_S, *model_S, *tree, T, config.correspondence_voxels * voxel_m);
    result.correspondences = matches.count;
    result.rmse_m = matches.rmse_m;
  };
  // PCL would complain on stderr about too few matches.
  note_matches(Pose::Identity());
  if (result.correspondences < config.min_points) return result;

  Icp icp;
  icp.setInputSource(segment.points_S);
  icp.setInputTarget(model_S);
  icp.setSearchMethodTarget(tree, true);
  SetUp(icp, config, voxel_m, segment.radius_m);
  Cloud aligned;
  icp.align(aligned);
  result.iterations = icp.iterations();
  const Eigen::Matrix4d solution = icp.getFinalTransformation();
  if (!solution.allFinite()) {
    result.correspondences = 0;
    result.rmse_m = 0;
    return result;
  }
  Pose T_old_new = Pose::Identity();  // takes the segment back to the model, in S
  // A rotation again after a product of many.
  const Eigen::Quaterniond rotation =
      Eigen::Quaterniond(Eigen::Matrix3d(solution.topLeftCorner<3, 3>())).normalized();
  T_old_new.linear() = rotation.toRotationMatrix();
  T_old_new.translation() = solution.topRightCorner<3, 1>();
  note_matches(T_old_new);

  const bool is_matched =
      result.correspondences >= config.min_points &&
      result.correspondences >= config.min_inlier_share * static_cast<double>(segment_W.size());
  if (!icp.hasConverged() || !is_matched ||
      !IsWithin(T_old_new.translation(), rotation, config, voxel_m)) {
    return result;
  }
  const Eigen::Translation3d from_S(segment.centroid_W);
  result.T_O = from_S * T_old_new.inverse() * from_S.inverse();
  result.converged = true;
  return result;
}

}  // namespace tsdfpp
