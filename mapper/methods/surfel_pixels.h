// What a frame's pixels say of surfaces: a point, a normal and how large a piece each stands for
// (docs/map.md, "`surfels`", the pixels; Keller et al. 2013, section 3, vertex and normal map).
#pragma once

#include <vector>

#include "core/types.h"
#include "mapper/methods/surfel_splats.h"

namespace tsdfpp {

class SurfelPixels {
 public:
  // The frame must be one by CheckFrameForm (mapper/map_reach.h), and outlive this with its labels.
  SurfelPixels(const Frame& frame, const cv::Mat& labels, double voxel_m);

  const Intrinsics& camera() const { return camera_; }
  const PixelRays& rays() const { return rays_; }

  // Whether the pixel has a valid depth and a label.
  bool IsUsable(std::size_t u, std::size_t v) const {
    return label(u, v) != kNoInstance && IsValidDepth(depth(u, v));
  }
  InstanceId label(std::size_t u, std::size_t v) const {
    return labels_.at<InstanceId>(static_cast<int>(v), static_cast<int>(u));
  }
  float depth(std::size_t u, std::size_t v) const {
    return frame_->depth.at<float>(static_cast<int>(v), static_cast<int>(u));
  }
  cv::Vec3b colour(std::size_t u, std::size_t v) const {
    return frame_->colour.at<cv::Vec3b>(static_cast<int>(v), static_cast<int>(u));
  }
  Eigen::Vector3d PointAt(std::size_t u, std::size_t v) const {
    return static_cast<double>(depth(u, v)) * rays_.At(u, v);
  }
  // Unit, towards the camera, in its frame; 0 where there is none.
  const Eigen::Vector3f& normal(std::size_t u, std::size_t v) const {
    return normals_[v * static_cast<std::size_t>(camera_.width) + u];
  }
  // The side of a pixel at a depth, metres: z / f with the smaller focal length.
  double Footprint(double depth_m) const { return depth_m / focal_; }
  // Pixels at most this far from the centre of a surfel that is added, at a depth, add none.
  double Reach(double depth_m) const;
  // Of the surfel that a pixel with a normal makes: the reach, and how far a pixel is from the
  // farthest corner of the piece of surface that it stands for.
  double RadiusAt(std::size_t u, std::size_t v) const;

 private:
  Eigen::Vector3f FindNormal(int u, int v) const;
  // The way along the surface to where it goes from a pixel along a row or a column; 0 where it
  // goes nowhere.
  Eigen::Vector3d StepAlong(int u, int v, int axis) const;
  // The depth of another pixel where the surface goes on to there: where it is of the same label,
  // and at most so much nearer or farther; else 0.
  float DepthWhereItGoesOn(int u, int v, int to_u, int to_v, double most_m) const;

  const Frame* frame_;
  cv::Mat labels_;
  Intrinsics camera_;
  PixelRays rays_;
  double voxel_m_;
  double focal_;
  std::vector<Eigen::Vector3f> normals_;
};

}  // namespace tsdfpp
