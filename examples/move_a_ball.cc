// Maps a ball in front of a wall from a synthetic depth image, moves the ball, asks the map how far
// away its surface is, saves the map, and reads it again.
#include <iostream>

#include "mapper/map_file.h"
#include "mapper/map_query.h"

using tsdfpp::Frame, tsdfpp::InstanceId, tsdfpp::Pose;

// A wall (the background) at z = 1 m and a ball (object 1) of radius 0.1 m around (0, 0, 0.7).
Frame Render() {
  Frame frame;
  frame.intrinsics = {160, 120, 140, 140, 79.5, 59.5};
  frame.depth = cv::Mat(120, 160, CV_32FC1, cv::Scalar(1));
  frame.colour = cv::Mat(120, 160, CV_8UC3, cv::Scalar(200, 120, 40));
  frame.mask = cv::Mat(120, 160, CV_16UC1, cv::Scalar(tsdfpp::kBackground));
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      const double length2 = Eigen::Vector3d((u - 79.5) / 140, (v - 59.5) / 140, 1).squaredNorm();
      const double root = 0.7 * 0.7 - length2 * (0.7 * 0.7 - 0.1 * 0.1);
      if (root < 0) continue;
      frame.depth.at<float>(v, u) = static_cast<float>((0.7 - std::sqrt(root)) / length2);
      frame.mask.at<InstanceId>(v, u) = 1;
    }
  }
  return frame;
}

int Fail(const tsdfpp::Error& error) {
  std::cerr << error.message << "\n";
  return 1;
}

int main() {
  const auto map = tsdfpp::MakeMap(tsdfpp::Method::kTsdfppAnchored, {});
  const Frame frame = Render();
  map->SetObjectPose(1, Pose(Eigen::Translation3d(0, 0, 0.7)));
  map->Fuse(frame, frame.mask);
  map->SetObjectPose(1, Pose(Eigen::Translation3d(0.15, 0, 0.7)));
  const auto query = tsdfpp::MapQuery::Of(*map).value();
  const auto ball = query.At(Eigen::Vector3d(0.15, 0, 0.58)).visible.value();
  std::cout << "object " << ball.id << " is " << ball.distance_m << " m away, towards "
            << -ball.gradient_W.transpose() << "\n";
  const auto saved = tsdfpp::SaveMap("ball.tsdfpp", *map);
  if (!saved) return Fail(saved.error());

  const auto loaded = tsdfpp::LoadMap("ball.tsdfpp");
  if (!loaded) return Fail(loaded.error());
  for (const InstanceId id : loaded->map->Objects()) {
    std::cout << "object " << id << " has " << loaded->map->ObjectMesh(id).triangles.size()
              << " triangles\n";
  }
  return 0;
}
