#include "tests/reference/dense_volume.h"

#include <algorithm>
#include <cmath>
#include <map>

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

namespace {

bool IsUsable(const Frame& frame, const cv::Mat& labels, int v, int u) {
  return labels.at<std::uint16_t>(v, u) != kNoInstance && IsValidDepth(frame.depth.at<float>(v, u));
}

// Marks the pixels near an outline pixel of their own label.
cv::Mat AtOutlines(const Frame& frame, const cv::Mat& labels, const MapConfig& config) {
  cv::Mat near(labels.size(), CV_8UC1, cv::Scalar(0));
  const double f = std::max(frame.intrinsics.fx, frame.intrinsics.fy);
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      if (!IsUsable(frame, labels, v, u)) continue;
      const auto label = labels.at<std::uint16_t>(v, u);
      const auto two_voxels = static_cast<float>(2 * config.voxel_m);
      const auto ends_at = [&](int row, int column) {
        return row >= 0 && column >= 0 && row < labels.rows && column < labels.cols &&
               labels.at<std::uint16_t>(row, column) != label &&
               IsUsable(frame, labels, row, column) &&
               frame.depth.at<float>(v, u) + two_voxels >= frame.depth.at<float>(row, column);
      };
      if (!ends_at(v, u - 1) && !ends_at(v, u + 1) && !ends_at(v - 1, u) && !ends_at(v + 1, u)) {
        continue;
      }
      const int reach =
          static_cast<int>(std::ceil(2 * config.voxel_m * f / frame.depth.at<float>(v, u)));
      for (int row = std::max(0, v - reach); row <= std::min(labels.rows - 1, v + reach); ++row) {
        const int last = std::min(labels.cols - 1, u + reach);
        for (int column = std::max(0, u - reach); column <= last; ++column) {
          if (labels.at<std::uint16_t>(row, column) == label)
            near.at<std::uint8_t>(row, column) = 1;
        }
      }
    }
  }
  return near;
}

// What the distances on all sides go on to; nothing where no side tells.
std::optional<float> GoneOn(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3i& voxel,
                            float h) {
  float sum = 0;
  float count = 0;
  ForEachVoxel(Box{{-1, -1, -1}, {1, 1, 1}}, [&](const Eigen::Vector3i& step) {
    if (step.isZero()) return;
    const Eigen::Vector3i far = voxel + 2 * step;
    if (!grid(voxel + step).observed() || !grid(far).observed()) return;
    const float next = grid(voxel + step).distance;
    const float after = grid(far).distance;
    if (std::abs(next - after) > 4 * h) return;
    sum += 2 * next - after;
    count += 1;
  });
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

}  // namespace

std::vector<RimVoxel> RimsOf(InstanceId id, const Frame& frame, const cv::Mat& labels,
                             const Pose& T_WL, const MapConfig& config,
                             const DenseGrid<DenseVoxel>& grid,
                             const std::function<bool(const Eigen::Vector3i&)>& is_free) {
  const float h = config.voxel();
  const cv::Mat near = AtOutlines(frame, labels, config);
  const Pose T_LC = T_WL.inverse() * frame.T_WC;
  const View view(frame, labels, T_WL, config);
  std::map<std::array<int, 3>, std::optional<RimVoxel>> rims;
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      if (near.at<std::uint8_t>(v, u) == 0 || labels.at<std::uint16_t>(v, u) != id) continue;
      if (!IsUsable(frame, labels, v, u)) continue;
      const Intrinsics& camera = frame.intrinsics;
      const double z = frame.depth.at<float>(v, u);
      const Eigen::Vector3d p_C((u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z,
                                z);
      const Eigen::Vector3d q = (T_LC * p_C) / config.voxel_m;
      const Eigen::Vector3i cube = q.array().floor().matrix().cast<int>();
      for (int i = 0; i < 8; ++i) {
        const Eigen::Vector3i corner = CubeCorner(cube, i);
        if (!is_free(corner)) continue;
        const auto [place, first] =
            rims.try_emplace(std::array{corner.x(), corner.y(), corner.z()});
        if (!first) continue;
        std::optional<float> distance = GoneOn(grid, corner, h);
        const std::optional<Seen> seen = view.Look(corner);
        if (!distance) continue;
        if (seen && seen->s > 0) distance = std::max(*distance, std::min(seen->s, h));
        RimVoxel& rim = place->second.emplace();
        rim.voxel = corner;
        rim.value.distance = Kept(std::clamp(*distance, -config.back(), config.front()));
        rim.value.weight = 1;
        const bool is_far = std::abs(rim.value.distance) > static_cast<float>(3 * config.voxel_m);
        if (is_far && !config.colour_whole_band) continue;
        rim.value.colours = 1;
        const auto& rgb = frame.colour.at<cv::Vec3b>(v, u);
        for (int c = 0; c < 3; ++c) rim.value.colour[c] = 256.0F * rgb[c];
      }
    }
  }
  std::vector<RimVoxel> found;
  for (const auto& [place, rim] : rims) {
    if (rim) found.push_back(*rim);
  }
  return found;
}

void CompleteRims(InstanceId id, const Frame& frame, const cv::Mat& labels, const Pose& T_WL,
                  const MapConfig& config, DenseVolume& volume) {
  const auto is_free = [&](const Eigen::Vector3i& v) { return !volume.grid(v).observed(); };
  for (const RimVoxel& rim : RimsOf(id, frame, labels, T_WL, config, volume.grid, is_free)) {
    volume.grid.At(rim.voxel) = rim.value;
    volume.blocks.AddBlockOf(rim.voxel);
  }
}

}  // namespace tsdfpp::reference
