// Method `surfels` as docs/map.md states it, pixel by pixel and surfel by surfel, with nothing in
// between: slow and obvious.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <vector>

#include "core/types.h"

namespace tsdfpp::reference {

struct PlainSurfel {
  Eigen::Vector3f centre_L;
  Eigen::Vector3f normal_L;
  float radius_m = 0;
  std::array<int, 3> colour{};  // times 256
  int confidence = 0;
  int born = 0;
};

struct PlainHit {
  InstanceId id = kNoInstance;
  double depth = 0;
  Eigen::Vector3d normal_W = Eigen::Vector3d::Zero();
};

class SurfelReference {
 public:
  SurfelReference(double voxel_m, int weight_cap) : h_(voxel_m), weight_cap_(weight_cap) {}

  void SetObjectPose(InstanceId id, const Pose& T_WO);
  void Fuse(const Frame& frame, const cv::Mat& labels);
  void Remove(InstanceId id) { objects_.erase(id); }

  std::vector<PlainSurfel> SurfelsOf(InstanceId id) const;
  // The surfaces along the ray through a pixel, as many as there are.
  std::vector<PlainHit> Cast(const Intrinsics& camera, const Pose& T_WC, int u, int v) const;

 private:
  struct Object {
    std::vector<PlainSurfel> surfels;
    std::optional<Pose> birth;
    std::optional<Pose> now;
    Pose T_WL() const;
  };
  struct Pixel {
    int u = 0;
    int v = 0;
    InstanceId id = kNoInstance;
    double z = 0;
    Eigen::Vector3d ray;
    Eigen::Vector3d point;
    bool has_normal = false;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    cv::Vec3b colour;
    bool lies_on_one = false;
    double extent = 0;
  };

  double Reach(double z) const;
  // Where a ray meets a surfel's plane from the front.
  static std::optional<Eigen::Vector3d> Meet(const Eigen::Vector3d& ray,
                                             const Eigen::Vector3d& centre,
                                             const Eigen::Vector3d& normal);
  std::optional<Eigen::Vector3d> LiesOn(const Pixel& pixel, const Eigen::Vector3d& centre,
                                        const Eigen::Vector3d& normal, double radius) const;
  std::optional<Eigen::Vector3d> Step(const std::vector<Pixel>& pixels, const Pixel& at, int du,
                                      int dv) const;
  std::vector<Pixel> PixelsOf(const Frame& frame, const cv::Mat& labels) const;
  bool IsSeenThrough(const std::vector<Pixel>& pixels, const Eigen::Vector3d& q) const;
  double RadiusOf(const Pixel& pixel) const;

  double h_;
  int weight_cap_;
  int frames_ = 0;
  Intrinsics k_;
  double f_ = 0;
  std::map<InstanceId, Object> objects_;
};

}  // namespace tsdfpp::reference
