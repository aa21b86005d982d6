#include "mapper/track/distance_term.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>

namespace tsdfpp {
namespace {

constexpr std::size_t kPointsPerTask = 512;
// Further out no voxel is, and indices stay far from the ends of their 21 bits.
constexpr double kFurthestVoxel = double{kBlockSide} * (kFurthestBlock + 1);
// Of a distance's gradient, which is at least 1 beside a surface in sight and 0 where the distance
// is truncated. Around a sharp edge the interpolated one falls to some 0.6.
constexpr float kLeastSlope = 0.3F;
// Corners that were observed once, among them those that a rim made up, count less.
constexpr float kFewObservations = 1;
// Distances are looked at up to so many times the Huber width: further ones count all the same.
constexpr double kFarthest_hubers = 10;

// The 4x4x4 voxels around a point, of which the middle eight are its corners.
class Neighbourhood {
 public:
  Neighbourhood(const VoxelReader& voxels, const Eigen::Vector3d& q) {
    const Index3 base = FloorOf(q);
    fraction_ = {static_cast<float>(q.x() - base.x), static_cast<float>(q.y() - base.y),
                 static_cast<float>(q.z() - base.z)};
    const Index3 first = base + Index3{-1, -1, -1};
    const Index3 block = BlockOf(first);
    const std::array<int, 3> start{first.x & 7, first.y & 7, first.z & 7};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (int i = 0; i < 4; ++i) {
        const int at = start[axis] + i;
        const auto shift = static_cast<unsigned>(axis);
        which_[axis][static_cast<std::size_t>(i)] = at >= kBlockSide ? 1 << shift : 0;
        place_[axis][static_cast<std::size_t>(i)] = (at & 7) << (3 * shift);
      }
    }
    const int reach = which_[0][3] | which_[1][3] | which_[2][3];
    for (int i = 0; i < 8; ++i) {
      if ((i & reach) != i) continue;
      blocks_[static_cast<std::size_t>(i)] =
          voxels.BlockAt(block + Index3{i & 1, (i >> 1) & 1, i >> 2});
    }
  }

  // SurfaceReader::SagAt().
  float Sag() const {
    // What the lines need: the corners (1 and 2 along each axis), and one voxel more on each side
    // of one axis.
    std::array<float, 64> distance{};
    std::array<std::uint8_t, 64> weight{};
    const auto read = [&](int x, int y, int z) {
      const auto i = static_cast<std::size_t>(x);
      const auto j = static_cast<std::size_t>(y);
      const auto k = static_cast<std::size_t>(z);
      const TsdfBlock* block =
          blocks_[static_cast<std::size_t>(which_[0][i] | which_[1][j] | which_[2][k])];
      if (block == nullptr) return false;
      const auto place = static_cast<std::size_t>(place_[0][i] | place_[1][j] | place_[2][k]);
      const std::size_t to = i + 4 * j + 16 * k;
      distance[to] = block->distance[place];
      weight[to] = block->weight[place];
      return weight[to] != 0;
    };
    for (int i = 0; i < 8; ++i) {
      if (!read(1 + (i & 1), 1 + ((i >> 1) & 1), 1 + (i >> 2))) return 0;
    }
    for (int line = 0; line < 4; ++line) {
      const int second = 1 + (line & 1);
      const int third = 1 + (line >> 1);
      for (const int end : {0, 3}) {
        read(end, second, third);
        read(third, end, second);
        read(second, third, end);
      }
    }
    constexpr std::array<std::size_t, 3> kStep{1, 4, 16};
    float sag = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t second = (axis + 1) % 3;
      const std::size_t third = (axis + 2) % 3;
      const float f = fraction_[axis];
      for (std::size_t line = 0; line < 4; ++line) {
        const std::size_t at = (1 + (line & 1)) * kStep[second] + (1 + (line >> 1)) * kStep[third];
        // The second difference at the point, of one of the four lines of voxels along an axis that
        // pass through the corners, times the line's share.
        const std::size_t step = kStep[axis];
        const float inner = distance[at + step];
        const float outer = distance[at + 2 * step];
        float low = distance[at] - 2 * inner + outer;
        float high = inner - 2 * outer + distance[at + 3 * step];
        const bool goes_on_up = weight[at + 3 * step] != 0;
        if (weight[at] == 0) low = goes_on_up ? high : 0;
        if (!goes_on_up) high = low;
        const float share = ((line & 1) != 0 ? fraction_[second] : 1 - fraction_[second]) *
                            ((line >> 1) != 0 ? fraction_[third] : 1 - fraction_[third]);
        sag += f * (1 - f) / 2 * (share * (low * (1 - f) + high * f));
      }
    }
    return sag;
  }

 private:
  std::array<std::array<int, 4>, 3> which_{};  // bit of the block along each axis
  std::array<std::array<int, 4>, 3> place_{};  // its part of the place in a block
  std::array<const TsdfBlock*, 8> blocks_{};
  std::array<float, 3> fraction_{};
};

// Of sizes of errors; 0 of none.
double RobustDeviation(std::vector<float> sizes) {
  constexpr double kNormalMedian = 1.4826;
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return kNormalMedian * static_cast<double>(*middle);
}

}  // namespace

SurfaceReader::SurfaceReader(const TsdfGrid& grid, double voxel_m)
    : voxels_(grid), per_voxel_(1 / voxel_m), voxel_m_(static_cast<float>(voxel_m)) {}

void SurfaceReader::Read(const Index3& base, VoxelCube& cube) const {
  cube.base = base;
  cube.least_weight = 0;
  const Corners corners = FindCorners(voxels_, base);
  int least = 255;
  for (std::size_t i = 0; i < 8; ++i) {
    const TsdfBlock* block = corners.block[i];
    if (block == nullptr) return;
    const auto place = static_cast<std::size_t>(corners.place[i]);
    cube.distance[i] = block->distance[place];
    least = std::min<int>(least, block->weight[place]);
  }
  cube.least_weight = least;
}

bool SurfaceReader::LinearAt(const Eigen::Vector3d& p_L, float sag_m, VoxelCube& cube,
                             Linear& linear) const {
  const Eigen::Vector3d q = p_L * per_voxel_;
  if (voxels_.empty() || !(q.cwiseAbs().maxCoeff() < kFurthestVoxel)) return false;
  const Index3 base = FloorOf(q);
  if (cube.base != base) Read(base, cube);
  if (cube.least_weight == 0) return false;
  const auto fx = static_cast<float>(q.x() - base.x);
  const auto fy = static_cast<float>(q.y() - base.y);
  const auto fz = static_cast<float>(q.z() - base.z);
  // Along x, then y, then z, with the slopes on the way.
  const std::array<float, 8>& d = cube.distance;
  const float x00 = d[1] - d[0];
  const float x10 = d[3] - d[2];
  const float x01 = d[5] - d[4];
  const float x11 = d[7] - d[6];
  const float c00 = d[0] + x00 * fx;
  const float c10 = d[2] + x10 * fx;
  const float c01 = d[4] + x01 * fx;
  const float c11 = d[6] + x11 * fx;
  const float c0 = c00 + (c10 - c00) * fy;
  const float c1 = c01 + (c11 - c01) * fy;
  const float x0 = x00 + (x10 - x00) * fy;
  const float x1 = x01 + (x11 - x01) * fy;
  const Eigen::Vector3f slope(x0 + (x1 - x0) * fz, (c10 - c00) + ((c11 - c01) - (c10 - c00)) * fz,
                              c1 - c0);
  linear.value_m = c0 + (c1 - c0) * fz - sag_m;
  linear.gradient_L = slope / voxel_m_;
  return true;
}

SurfaceSample SurfaceReader::At(const Eigen::Vector3d& p_L, float sag_m, VoxelCube& cube) const {
  SurfaceSample sample;
  Linear linear;
  if (!LinearAt(p_L, sag_m, cube, linear)) return sample;
  sample.is_observed = true;
  sample.weight = static_cast<float>(cube.least_weight);
  sample.value_m = linear.value_m;
  sample.gradient_L = linear.gradient_L;
  sample.slope = sample.gradient_L.norm();
  sample.has_slope = sample.slope >= kLeastSlope;
  return sample;
}

SurfaceSample SurfaceReader::At(const Eigen::Vector3d& p_L, float sag_m) const {
  VoxelCube cube;
  return At(p_L, sag_m, cube);
}

float SurfaceReader::SagAt(const Eigen::Vector3d& p_L) const {
  const Eigen::Vector3d q = p_L * per_voxel_;
  if (voxels_.empty() || !(q.cwiseAbs().maxCoeff() < kFurthestVoxel)) return 0;
  return Neighbourhood(voxels_, q).Sag();
}

DistanceTerm::DistanceTerm(const SurfaceReader& model, std::span<const SegmentPoint> points,
                           const MotionFrame& frame, double voxel_m, const Intrinsics& camera,
                           const SdfTrackConfig& config, std::size_t stride)
    : model_(&model),
      points_(points),
      frame_(frame),
      config_(config),
      voxel_m_(voxel_m),
      lateral_per_m_(config.lateral_px / std::max(camera.fx, camera.fy)),
      stride_(stride),
      huber_m_(config.huber_voxels * voxel_m) {}

double DistanceTerm::WeightOf(const SurfaceSample& at, const Eigen::Vector3d& p_C,
                              const Eigen::Vector3d& y, const Eigen::Vector3d& camera_L) const {
  const double model_m = config_.model_voxels * voxel_m_;
  const double least_variance = model_m * model_m + config_.axial_m * config_.axial_m;
  const Eigen::Vector3d n = at.normal_L().cast<double>();
  const double cosine = std::min(1.0, std::abs(n.dot(y - camera_L)) / p_C.norm());
  const double axial = config_.Axial_m(p_C.z()) * cosine;
  const double lateral_squared =
      lateral_per_m_ * lateral_per_m_ * p_C.z() * p_C.z() * (1 - cosine * cosine);
  const double variance = model_m * model_m + axial * axial + lateral_squared;
  return std::min(1.0, least_variance / variance) *
         double{at.weight / (at.weight + kFewObservations)};
}

void DistanceTerm::KeepAt(const Pose& T_LC) {
  kept_.assign(points_.size(), {});
  cubes_.resize(points_.size());
  const Eigen::Vector3d camera_L = T_LC.translation();
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, Taken(), kPointsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          const std::size_t i = k * stride_;
          const Eigen::Vector3d p_C = points_[i].p_C.cast<double>();
          const Eigen::Vector3d y = T_LC * p_C;
          Kept& kept = kept_[i];
          if (config_.curved) kept.sag_m = model_->SagAt(y);
          const SurfaceSample at = model_->At(y, kept.sag_m, cubes_[i]);
          if (!at.has_slope) continue;
          kept.per_slope = 1 / at.slope;
          kept.weight = static_cast<float>(WeightOf(at, p_C, y, camera_L));
          kept.distance_m = at.distance_m();
        }
      },
      tbb::simple_partitioner());
}

void DistanceTerm::AddChunk(const Pose& T_LC, std::size_t begin, std::size_t end,
                            NormalEquations& sums) const {
  // Rows are written here and added up later: a vector that is read right after its numbers were
  // written one by one waits for them.
  struct Row {
    Vector6 J;
    double r;
    double weight;
  };
  constexpr std::size_t kRows = 64;
  std::array<Row, kRows> rows;
  std::size_t count = 0;
  const auto add_up = [&] {
    for (std::size_t i = 0; i < count; ++i) {
      const Row& row = rows[i];
      const Vector6 weighted = row.weight * row.J;
      sums.g += weighted * row.r;
      for (int column = 0; column < 6; ++column) {
        sums.H.col(column) += weighted * row.J[column];
      }
    }
    count = 0;
  };
  const double farthest_m = kFarthest_hubers * huber_m_;
  for (std::size_t k = begin; k < end; ++k) {
    const std::size_t i = k * stride_;
    const Kept& kept = kept_[i];
    if (!(kept.per_slope > 0)) {
      sums.cost += huber_m_ * huber_m_ / 2;
      continue;
    }
    const Eigen::Vector3d y = T_LC * points_[i].p_C.cast<double>();
    SurfaceReader::Linear at;
    const bool is_observed = model_->LinearAt(y, kept.sag_m, cubes_[i], at);
    const double weight = kept.weight;
    const double r = is_observed ? double{kept.per_slope * at.value_m} : kept.distance_m;
    const double size = std::min(std::abs(r), farthest_m);
    const bool is_far = size > huber_m_;
    sums.cost += weight * (is_far ? huber_m_ * (size - huber_m_ / 2) : r * r / 2);
    if (!is_observed || size >= farthest_m) continue;
    const double slack = is_far ? huber_m_ / size : 1;
    const Eigen::Vector3d g = kept.per_slope * at.gradient_L.cast<double>();
    Row& row = rows[count++];
    row.J.head<3>() = g;
    row.J.tail<3>() = (y - frame_.centre).cross(g) / frame_.radius_m;
    row.r = r;
    row.weight = weight * slack;
    if (count == kRows) add_up();
  }
  add_up();
}

NormalEquations DistanceTerm::Sums(const Pose& T_LC) const {
  if (kept_.size() != points_.size()) std::abort();  // KeepAt() comes first
  const std::size_t count = Taken();
  const std::size_t chunks = (count + kPointsPerTask - 1) / kPointsPerTask;
  constexpr std::size_t kChunksAtOnce = 32;
  NormalEquations sums;
  for (std::size_t first = 0; first < chunks; first += kChunksAtOnce) {
    std::array<NormalEquations, kChunksAtOnce> parts;
    const std::size_t last = std::min(chunks, first + kChunksAtOnce);
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(first, last),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t chunk = range.begin(); chunk != range.end(); ++chunk) {
            const std::size_t begin = chunk * kPointsPerTask;
            AddChunk(T_LC, begin, std::min(count, begin + kPointsPerTask), parts[chunk - first]);
          }
        },
        tbb::simple_partitioner());
    for (std::size_t chunk = first; chunk < last; ++chunk) {
      const NormalEquations& part = parts[chunk - first];
      sums.H += part.H;
      sums.g += part.g;
      sums.cost += part.cost;
    }
  }
  return sums;
}

DistanceCounts DistanceTerm::Count(const Pose& T_LC) const {
  struct Found {
    bool is_observed = false;
    bool is_inlier = false;
    float size_m = -1;  // below 0 where there is no distance
  };
  const double inlier_m = config_.inlier_voxels * voxel_m_;
  std::vector<Found> found(Taken());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, found.size(), kPointsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          const std::size_t i = k * stride_;
          const SurfaceSample at = SampleAt(T_LC, i);
          found[k].is_observed = at.is_observed;
          if (!at.has_slope) continue;
          found[k].size_m = std::abs(at.distance_m());
          const double noise_m = config_.Axial_m(points_[i].p_C.z());
          found[k].is_inlier = found[k].size_m < inlier_m + kNoiseDeviations * noise_m;
        }
      },
      tbb::simple_partitioner());
  DistanceCounts counts;
  std::vector<float> sizes;
  sizes.reserve(found.size());
  for (const Found& of : found) {
    ++counts.points;
    counts.observed += of.is_observed ? 1 : 0;
    counts.inliers += of.is_inlier ? 1 : 0;
    if (of.size_m < 0) continue;
    sizes.push_back(of.size_m);
  }
  counts.deviation_m = RobustDeviation(std::move(sizes));
  return counts;
}

double DistanceTerm::KeptDeviation_m() const {
  std::vector<float> sizes;
  sizes.reserve(Taken());
  for (std::size_t i = 0; i < kept_.size(); i += stride_) {
    if (kept_[i].per_slope > 0) sizes.push_back(std::abs(kept_[i].distance_m));
  }
  return RobustDeviation(std::move(sizes));
}

}  // namespace tsdfpp
