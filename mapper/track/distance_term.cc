#include "mapper/track/distance_term.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "core/robust_deviation.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kPointsPerTask = 512;
// Corners that were observed once, among them those that a rim made up, count less.
constexpr float kFewObservations = 1;
// Distances are looked at up to so many times the Huber width: further ones count all the same.
constexpr double kFarthest_hubers = 10;

}  // namespace

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
  const double steep = at.slope > config_.certain_slope && config_.certain_slope > 0
                           ? config_.certain_slope / double{at.slope}
                           : 1;
  return steep * std::min(1.0, least_variance / variance) *
         double{at.weight / (at.weight + kFewObservations)};
}

bool DistanceTerm::IsOfTwoSurfaces(const SurfaceSample& at, const Eigen::Vector3d& ray_L) const {
  if (config_.max_slope <= 0 || at.slope <= config_.max_slope) return false;
  return -at.gradient_L.cast<double>().dot(ray_L) > config_.max_fall * ray_L.norm();
}

void DistanceTerm::KeepAt(const Pose& T_LC) {
  last_.reset();
  kept_.assign(Taken(), {});
  cubes_.resize(Taken());
  const Eigen::Vector3d camera_L = T_LC.translation();
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, Taken(), kPointsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        SurfaceReader::SagCache& sags = model_->CacheOfThread();
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          const Eigen::Vector3d p_C = points_[k * stride_].p_C.cast<double>();
          const Eigen::Vector3d y = T_LC * p_C;
          Kept& kept = kept_[k];
          if (config_.curved) kept.sag_m = model_->SagAt(y, sags, cubes_[k]);
          const SurfaceSample at = model_->At(y, kept.sag_m, cubes_[k]);
          if (!at.has_slope || IsOfTwoSurfaces(at, y - camera_L)) continue;
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
      // In blocks of two columns, from the diagonal down.
      sums.H.leftCols<2>() += weighted * row.J.head<2>().transpose();
      sums.H.block<4, 2>(2, 2) += weighted.tail<4>() * row.J.segment<2>(2).transpose();
      sums.H.block<2, 2>(4, 4) += weighted.tail<2>() * row.J.tail<2>().transpose();
    }
    count = 0;
  };
  const double farthest_m = kFarthest_hubers * huber_m_;
  const double per_radius = 1 / frame_.radius_m;
  for (std::size_t k = begin; k < end; ++k) {
    const Kept& kept = kept_[k];
    if (!(kept.per_slope > 0)) {
      sums.cost += huber_m_ * huber_m_ / 2;
      continue;
    }
    const Eigen::Vector3d y = T_LC * points_[k * stride_].p_C.cast<double>();
    SurfaceReader::Linear at;
    const bool is_observed = model_->LinearAt(y, kept.sag_m, cubes_[k], at);
    const double weight = kept.weight;
    const double r = is_observed ? double{kept.per_slope * at.value_m} : kept.distance_m;
    const double size = std::min(std::abs(r), farthest_m);
    const bool is_far = size > huber_m_;
    sums.cost += weight * (is_far ? huber_m_ * (size - huber_m_ / 2) : r * r / 2);
    if (!is_observed || size >= farthest_m) continue;
    const double slack = is_far ? huber_m_ / size : 1;
    const double gx = kept.per_slope * at.slope_x;
    const double gy = kept.per_slope * at.slope_y;
    const double gz = kept.per_slope * at.slope_z;
    // The arm of a turn, in radii.
    const double ax = (y.x() - frame_.centre.x()) * per_radius;
    const double ay = (y.y() - frame_.centre.y()) * per_radius;
    const double az = (y.z() - frame_.centre.z()) * per_radius;
    Row& row = rows[count++];
    row.J << gx, gy, gz, ay * gz - az * gy, az * gx - ax * gz, ax * gy - ay * gx;
    row.r = r;
    row.weight = weight * slack;
    if (count == kRows) add_up();
  }
  add_up();
  sums.H.triangularView<Eigen::StrictlyUpper>() = sums.H.transpose();
}

NormalEquations DistanceTerm::Sums(const Pose& T_LC) const {
  if (kept_.size() != Taken()) std::abort();  // KeepAt() comes first
  if (last_ && SameNumbers(last_->T_LC, T_LC)) return last_->sums;
  const std::size_t count = Taken();
  const std::size_t chunks = (count + kPointsPerTask - 1) / kPointsPerTask;
  constexpr std::size_t kChunksAtOnce = 32;
  NormalEquations& sums = last_.emplace(SumsAt{T_LC, {}}).sums;
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
          const SurfaceSample at = SampleAt(T_LC, k);
          found[k].is_observed = at.is_observed;
          if (!at.has_slope) continue;
          found[k].size_m = std::abs(at.distance_m());
          const double noise_m = config_.Axial_m(points_[k * stride_].p_C.z());
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
  for (const Kept& kept : kept_) {
    if (kept.per_slope > 0) sizes.push_back(std::abs(kept.distance_m));
  }
  return RobustDeviation(std::move(sizes));
}

}  // namespace tsdfpp
