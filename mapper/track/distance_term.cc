#include "mapper/track/distance_term.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
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
  struct Value {
    float distance = 0;
    int weight = 0;  // 0 where unobserved
  };

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

  // 0 to 3 along each axis; 1 and 2 are the corners.
  Value At(int x, int y, int z) const {
    const auto i = static_cast<std::size_t>(x);
    const auto j = static_cast<std::size_t>(y);
    const auto k = static_cast<std::size_t>(z);
    const TsdfBlock* block =
        blocks_[static_cast<std::size_t>(which_[0][i] | which_[1][j] | which_[2][k])];
    if (block == nullptr) return {};
    const auto place = static_cast<std::size_t>(place_[0][i] | place_[1][j] | place_[2][k]);
    return {block->distance[place], block->weight[place]};
  }

  // SurfaceReader::SagAt().
  float Sag() const {
    for (int i = 0; i < 8; ++i) {
      if (At(1 + (i & 1), 1 + ((i >> 1) & 1), 1 + (i >> 2)).weight == 0) return 0;
    }
    float sag = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const float f = Fraction(axis);
      for (int line = 0; line < 4; ++line) sag += f * (1 - f) / 2 * LineSag(axis, line);
    }
    return sag;
  }

 private:
  float Fraction(int axis) const { return fraction_[static_cast<std::size_t>(axis)]; }

  // The second difference at the point, of one of the four lines of voxels along an axis that pass
  // through the corners (bits 0 and 1 say which, of the next two axes), times the line's share.
  float LineSag(int axis, int line) const {
    const int second = (axis + 1) % 3;
    const int third = (axis + 2) % 3;
    std::array<int, 3> at{};
    at[static_cast<std::size_t>(second)] = 1 + (line & 1);
    at[static_cast<std::size_t>(third)] = 1 + (line >> 1);
    std::array<Value, 4> values;
    for (int i = 0; i < 4; ++i) {
      at[static_cast<std::size_t>(axis)] = i;
      values[static_cast<std::size_t>(i)] = At(at[0], at[1], at[2]);
    }
    float low = values[0].distance - 2 * values[1].distance + values[2].distance;
    float high = values[1].distance - 2 * values[2].distance + values[3].distance;
    if (values[0].weight == 0) low = values[3].weight == 0 ? 0 : high;
    if (values[3].weight == 0) high = low;
    const float share = ((line & 1) != 0 ? Fraction(second) : 1 - Fraction(second)) *
                        ((line >> 1) != 0 ? Fraction(third) : 1 - Fraction(third));
    return share * (low * (1 - Fraction(axis)) + high * Fraction(axis));
  }

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

SurfaceSample SurfaceReader::At(const Eigen::Vector3d& p_L, float sag_m) const {
  SurfaceSample sample;
  const Eigen::Vector3d q = p_L * per_voxel_;
  if (voxels_.empty() || !(q.cwiseAbs().maxCoeff() < kFurthestVoxel)) return sample;
  const Corners corners = FindCorners(voxels_, q);
  std::array<float, 8> d{};
  int least = 255;
  for (std::size_t i = 0; i < 8; ++i) {
    const TsdfBlock* block = corners.block[i];
    if (block == nullptr) return sample;
    const auto place = static_cast<std::size_t>(corners.place[i]);
    d[i] = block->distance[place];
    least = std::min<int>(least, block->weight[place]);
  }
  if (least == 0) return sample;
  sample.is_observed = true;
  sample.weight = static_cast<float>(least);
  const auto [fx, fy, fz] = corners.fraction;
  // Along x, then y, then z, with the slopes on the way.
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
  sample.value_m = c0 + (c1 - c0) * fz - sag_m;
  sample.gradient_L = slope / voxel_m_;
  sample.slope = sample.gradient_L.norm();
  sample.has_slope = sample.slope >= kLeastSlope;
  return sample;
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
          const SurfaceSample at = model_->At(y, kept.sag_m);
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
  const double farthest_m = kFarthest_hubers * huber_m_;
  for (std::size_t k = begin; k < end; ++k) {
    const std::size_t i = k * stride_;
    const Eigen::Vector3d p_C = points_[i].p_C.cast<double>();
    const Eigen::Vector3d y = T_LC * p_C;
    const SurfaceSample at = SampleAt(T_LC, i);
    const Kept& kept = kept_[i];
    if (!(kept.per_slope > 0)) {
      sums.cost += huber_m_ * huber_m_ / 2;
      continue;
    }
    const double weight = kept.weight;
    const double r = at.is_observed ? double{kept.per_slope * at.value_m} : kept.distance_m;
    const double size = std::min(std::abs(r), farthest_m);
    const bool is_far = size > huber_m_;
    sums.cost += weight * (is_far ? huber_m_ * (size - huber_m_ / 2) : r * r / 2);
    if (!at.is_observed || size >= farthest_m) continue;
    const double slack = is_far ? huber_m_ / size : 1;
    const Eigen::Vector3d g = kept.per_slope * at.gradient_L.cast<double>();
    Vector6 J;
    J.head<3>() = g;
    J.tail<3>() = (y - frame_.centre).cross(g) / frame_.radius_m;
    const Vector6 weighted = weight * slack * J;
    sums.g += weighted * r;
    sums.H.noalias() += weighted * J.transpose();
  }
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
