// One voxel of the references: what an observation does to it, and its interpolation (docs/map.md,
// "Observation of a voxel" and "Fusion of an observation into a voxel").
#pragma once

#include <array>
#include <optional>

#include "core/types.h"
#include "mapper/map_config.h"

namespace tsdfpp::reference {

struct DenseVoxel {
  float distance = 0;             // metres
  float weight = 0;               // observed where above 0
  std::array<float, 3> colour{};  // 8.8 fixed point, a whole number
  int colours = 0;                // n, the observations in `colour`

  bool observed() const { return weight > 0; }
  // The nearest 8-bit levels.
  Colour Rounded() const;
};

// What a frame says about a voxel in view.
struct Seen {
  float s = 0;          // metres along the ray, positive in front of the surface
  float surface_z = 0;  // metres along the optical axis: of the surface that the pixel shows
  float voxel_z = 0;    // and of the voxel
  InstanceId label = kNoInstance;
  Colour colour{};
  int pixel = 0;  // row-major
};

// How one frame sees the lattice whose pose is T_WL.
class View {
 public:
  View(const Frame& frame, const cv::Mat& labels, const Pose& T_WL, const MapConfig& config);
  // Nothing where the voxel is not in view. Pixels labelled kNoInstance count as invalid depth.
  std::optional<Seen> Look(const Eigen::Vector3i& voxel) const;

 private:
  const Frame& frame_;
  const cv::Mat& labels_;
  Eigen::Matrix4f M_;
  float h_;
};

// A distance as a voxel keeps it: in half precision.
float Kept(float distance);

bool InBand(float s, const MapConfig& config);

// In band or clamped; nothing behind the band. `colour_all`: whatever the distance.
void FuseSeen(const Seen& seen, const MapConfig& config, DenseVoxel& voxel,
              bool colour_all = false);

// The eight corners around a point given in voxels.
struct Neighbourhood {
  explicit Neighbourhood(const Eigen::Vector3d& q);
  float Coefficient(int corner) const;
  // docs/map.md, "Resampling".
  float Interpolate(const std::array<float, 8>& corners) const;

  Eigen::Vector3i base;
  std::array<float, 3> f{};
};

// The corner nearest to the point: the upper one in each axis where the fraction is 0.5 or more.
int NearestCorner(const Neighbourhood& place);

// docs/map.md, "Resampling": nothing where the corners do not suffice.
std::optional<DenseVoxel> InterpolateVoxel(const Neighbourhood& place,
                                           const std::array<DenseVoxel, 8>& corners,
                                           Resampling resampling);

}  // namespace tsdfpp::reference
