#include "tests/reference/dense_volume.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp::reference {

Eigen::Vector3i BlockSet::BlockOf(const Eigen::Vector3i& voxel) {
  Eigen::Vector3i block;
  for (int a = 0; a < 3; ++a) block[a] = static_cast<int>(std::floor(voxel[a] / 8.0));
  return block;
}

bool BlockSet::HasBlockOf(const Eigen::Vector3i& voxel) const {
  const Eigen::Vector3i b = BlockOf(voxel);
  return blocks_.contains({b.z(), b.y(), b.x()});
}

void BlockSet::AddBlockOf(const Eigen::Vector3i& voxel) {
  const Eigen::Vector3i b = BlockOf(voxel);
  blocks_.insert({b.z(), b.y(), b.x()});
}

void BlockSet::FreeUnless(const std::function<bool(const Eigen::Vector3i&)>& held) {
  std::erase_if(blocks_, [&](const std::array<int, 3>& zyx) {
    const Eigen::Vector3i low = 8 * Eigen::Vector3i(zyx[2], zyx[1], zyx[0]);
    bool any = false;
    ForEachVoxel(Box{low, low + Eigen::Vector3i::Constant(7)},
                 [&](const Eigen::Vector3i& v) { any = any || held(v); });
    return !any;
  });
}

void Allocate(const Frame& frame, const cv::Mat& labels, const Pose& T_WL, const MapConfig& config,
              const std::function<bool(InstanceId)>& wanted, BlockSet& blocks) {
  const double h = config.voxel_m;
  const double front = config.trunc_front_voxels * h;
  const double back = config.trunc_back_voxels * h;
  const Intrinsics& camera = frame.intrinsics;
  const Pose T_LC = T_WL.inverse() * frame.T_WC;
  const double f = std::min(camera.fx, camera.fy);
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const InstanceId label = labels.at<std::uint16_t>(v, u);
      const float z = frame.depth.at<float>(v, u);
      if (label == kNoInstance || !IsValidDepth(z) || !wanted(label)) continue;
      // Whether the next coarser grid of pixels is too coarse at this depth.
      bool needed = true;
      for (const int grid : {4, 2, 1}) {
        if (u % grid == 0 && v % grid == 0) {
          const bool on_coarser = u % (2 * grid) == 0 && v % (2 * grid) == 0;
          if (!on_coarser) needed = z > 3 * h * f / (2 * grid);
          break;
        }
      }
      if (!needed) continue;
      const Eigen::Vector3d ray_C((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
      const double r = z * ray_C.norm();
      const Eigen::Vector3d e = T_LC.linear() * ray_C.normalized();
      std::vector<double> ranges;
      for (int k = 0; r - front + 2 * h * k < r + back; ++k)
        ranges.push_back(r - front + 2 * h * k);
      ranges.push_back(r + back);
      for (const double range : ranges) {
        if (range < 0) continue;
        const Eigen::Vector3d p_L = T_LC.translation() + range * e;
        const Eigen::Vector3d nearest = (p_L / h + Eigen::Vector3d::Constant(0.5)).array().floor();
        blocks.AddBlockOf(nearest.cast<int>());
      }
    }
  }
}

std::vector<Eigen::Vector3i> ObservedVoxels(const DenseGrid<DenseVoxel>& grid) {
  std::vector<Eigen::Vector3i> voxels;
  ForEachVoxel(grid.box(), [&](const Eigen::Vector3i& v) {
    if (grid(v).observed()) voxels.push_back(v);
  });
  return voxels;
}

bool IsCrossed(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3i& cube) {
  bool inside = false;
  bool outside = false;
  for (int i = 0; i < 8; ++i) {
    const DenseVoxel& voxel = grid(CubeCorner(cube, i));
    if (!voxel.observed()) return false;
    (voxel.distance < 0 ? inside : outside) = true;
  }
  return inside && outside;
}

std::vector<Eigen::Vector3i> CrossedCubes(const DenseGrid<DenseVoxel>& grid) {
  std::vector<Eigen::Vector3i> cubes;
  ForEachVoxel(grid.box(), [&](const Eigen::Vector3i& v) {
    if (IsCrossed(grid, v)) cubes.push_back(v);
  });
  return cubes;
}

std::optional<float> DistanceAt(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3d& q) {
  const Neighbourhood place(q);
  std::array<float, 8> distances{};
  for (int i = 0; i < 8; ++i) {
    if (place.Coefficient(i) == 0) continue;
    const DenseVoxel& voxel = grid(CubeCorner(place.base, i));
    if (!voxel.observed()) return std::nullopt;
    distances[i] = voxel.distance;
  }
  return place.Interpolate(distances);
}

bool Covers(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3d& q, const MapConfig& config) {
  const Eigen::Vector3i base = q.array().floor().matrix().cast<int>();
  // The closed cubes that hold q: on a face of the lattice there is one on either side of it.
  for (int i = 0; i < 8; ++i) {
    bool holds = true;
    Eigen::Vector3i cube = base;
    for (int a = 0; a < 3; ++a) {
      if (((i >> a) & 1) == 0) continue;
      holds = holds && q[a] == base[a];
      --cube[a];
    }
    if (holds && IsCrossed(grid, cube)) return true;
  }
  const std::optional<float> distance = DistanceAt(grid, q);
  return distance && *distance >= -config.back() && *distance < 0;
}

DenseGrid<std::uint8_t> CoverOfLattice(const DenseGrid<DenseVoxel>& grid, const MapConfig& config) {
  DenseGrid<std::uint8_t> cover(grid.box());
  ForEachVoxel(grid.box(), [&](const Eigen::Vector3i& v) {
    const DenseVoxel& voxel = grid(v);
    if (!voxel.observed()) return;
    if (voxel.distance < 0 && voxel.distance >= -config.back()) cover.At(v) = 1;
    if (!IsCrossed(grid, v)) return;
    for (int i = 0; i < 8; ++i) cover.At(CubeCorner(v, i)) = 1;
  });
  return cover;
}

Eigen::Vector3d SourcePoint(const Pose& T_rel_inverse, const Eigen::Vector3i& voxel, double h) {
  const Eigen::Vector3d p = h * voxel.cast<double>();
  return (T_rel_inverse * p) / h;
}

DenseVolume Resample(const DenseVolume& old, const Pose& T_rel, const MapConfig& config) {
  const Pose T_rel_inverse = T_rel.inverse();
  DenseVolume moved(old.grid.box());
  ForEachVoxel(old.grid.box(), [&](const Eigen::Vector3i& v) {
    const Neighbourhood place(SourcePoint(T_rel_inverse, v, config.voxel_m));
    std::array<DenseVoxel, 8> corners;
    for (int i = 0; i < 8; ++i) corners[i] = old.grid(CubeCorner(place.base, i));
    const std::optional<DenseVoxel> value = InterpolateVoxel(place, corners, config.resampling);
    if (!value) return;
    if (old.grid.box().AtRim(v)) BoxTooSmall(v);
    moved.grid.At(v) = *value;
    moved.blocks.AddBlockOf(v);
  });
  return moved;
}

void FuseObject(InstanceId id, const View& view, const MapConfig& config, DenseVolume& volume,
                DenseGrid<std::uint8_t>* votes) {
  const float h = config.voxel();
  volume.blocks.ForEachVoxelOfBlocks([&](const Eigen::Vector3i& v) {
    const std::optional<Seen> seen = view.Look(v);
    if (!seen) return;
    DenseVoxel& voxel = volume.grid.At(v);
    if (seen->label == id) {
      FuseSeen(*seen, config, voxel);
      if (votes != nullptr && InBand(seen->s, config)) votes->At(v) = 1;
      return;
    }
    const bool contradicted =
        voxel.observed() && voxel.distance < -0.5F * h && seen->s >= -0.5F * h;
    if (!config.contradiction || !contradicted) return;
    voxel = DenseVoxel{};
    if (seen->s > h) {
      voxel.distance = Kept(std::min(seen->s, config.front()));
      voxel.weight = 1;
    }
  });
}

}  // namespace tsdfpp::reference
