#include "tests/sequence/box_source.h"

#include <cmath>
#include <limits>

#include "core/pose_text.h"

namespace tsdfpp::test {
namespace {

constexpr double kWall_m = 1.5;
const Eigen::Vector3d kHalf(0.1, 0.08, 0.06);  // of a box's sides

Pose CameraAt(int index) {
  Pose pose = Pose::Identity();
  pose.linear() =
      Eigen::AngleAxisd(0.05 * index - 0.1, Eigen::Vector3d(0.2, 1, 0.1).normalized()).matrix();
  pose.translation() = Eigen::Vector3d(0.06 * index - 0.1, 0.01 * index, 0.02 * index);
  return PoseThroughText(pose);
}

Pose BoxAt(InstanceId id, int index) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::AngleAxisd(id == 3 ? 0.4 : -0.3, Eigen::Vector3d::UnitY()).matrix();
  pose.translation() = id == 3 ? Eigen::Vector3d(-0.12, 0.02, 1.2)
                               : Eigen::Vector3d(0.15 - 0.01 * index, -0.03, 0.9);
  return PoseThroughText(pose);
}

// The ray's parameter where it enters the box, by slabs; infinite where it misses.
double HitBox(const Pose& T_WO, const Eigen::Vector3d& origin_W, const Eigen::Vector3d& along_W) {
  const Eigen::Vector3d o = T_WO.inverse() * origin_W;
  const Eigen::Vector3d d = T_WO.linear().transpose() * along_W;
  double in = 0;
  double out = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (-kHalf[axis] - o[axis]) / d[axis];
    const double b = (kHalf[axis] - o[axis]) / d[axis];
    in = std::max(in, std::min(a, b));
    out = std::min(out, std::max(a, b));
  }
  return in < out ? in : std::numeric_limits<double>::infinity();
}

TriangleMesh Box() {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.push_back(Eigen::Vector3d((i & 1) ? kHalf.x() : -kHalf.x(),
                                            (i & 2) ? kHalf.y() : -kHalf.y(),
                                            (i & 4) ? kHalf.z() : -kHalf.z())
                                .cast<float>());
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

}  // namespace

BoxSource::BoxSource(int frames) {
  info_.name = "boxes";
  info_.intrinsics = {64, 48, 60, 61, 31.25, 23.75};
  info_.first_index = 0;
  info_.frame_count = frames;
  info_.objects = {{0, "background", "background"}, {3, "left", "box"}, {8, "right", "box"}};
}

Expected<Frame> BoxSource::Read(int index) {
  Frame frame;
  frame.index = index;
  frame.time_s = index / info_.rate_hz;
  frame.intrinsics = info_.intrinsics;
  frame.T_WC = CameraAt(index);
  frame.T_WO = {{3, BoxAt(3, index)}, {8, BoxAt(8, index)}};
  const Intrinsics& k = info_.intrinsics;
  frame.colour.create(k.height, k.width, CV_8UC3);
  frame.depth.create(k.height, k.width, CV_32FC1);
  frame.mask.create(k.height, k.width, CV_16UC1);
  for (int y = 0; y < k.height; ++y) {
    for (int x = 0; x < k.width; ++x) {
      const Eigen::Vector3d along =
          frame.T_WC.linear() * Eigen::Vector3d((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1);
      const Eigen::Vector3d origin = frame.T_WC.translation();
      double z = (kWall_m - origin.z()) / along.z();  // along has z = 1 in the camera
      InstanceId id = kBackground;
      for (const auto& [box, T_WO] : frame.T_WO) {
        const double hit = HitBox(T_WO, origin, along);
        if (hit < z) {
          z = hit;
          id = box;
        }
      }
      frame.depth.at<float>(y, x) = static_cast<float>(z);
      frame.mask.at<InstanceId>(y, x) = id;
      frame.colour.at<cv::Vec3b>(y, x) =
          cv::Vec3b(static_cast<std::uint8_t>(id * 20), static_cast<std::uint8_t>(4 * x),
                    static_cast<std::uint8_t>(5 * y));
    }
  }
  return frame;
}

Expected<std::vector<TrueModel>> BoxSource::Truth() {
  TriangleMesh wall;
  wall.vertices = {{-3, -3, kWall_m}, {3, -3, kWall_m}, {3, 3, kWall_m}, {-3, 3, kWall_m}};
  wall.triangles = {{0, 2, 1}, {0, 3, 2}};
  return std::vector<TrueModel>{
      {info_.objects[0], wall, {"wall"}, {0, 0}},
      {info_.objects[1], Box(), {"box"}, std::vector<std::uint16_t>(12, 0)},
      {info_.objects[2], Box(), {"box"}, std::vector<std::uint16_t>(12, 0)}};
}

}  // namespace tsdfpp::test
