#include "tests/reference/ray_reference.h"

#include <algorithm>
#include <cmath>

#include "mapper/voxel_inspection.h"
#include "tests/reference/dense_volume.h"

namespace tsdfpp::reference {
namespace {

constexpr double kStep_voxels = 0.02;  // along the optical axis

// The distance at q (voxels) from eight observed corners.
std::optional<double> Trilinear(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3d& q) {
  const Eigen::Vector3i base = q.array().floor().matrix().cast<int>();
  const Eigen::Vector3d f = q - base.cast<double>();
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const DenseVoxel& voxel = grid(CubeCorner(base, corner));
    if (!voxel.observed()) return std::nullopt;
    double weight = 1;
    for (int a = 0; a < 3; ++a) weight *= ((corner >> a) & 1) != 0 ? f[a] : 1 - f[a];
    sum += weight * double{voxel.distance};
  }
  return sum;
}

// By small differences that stay inside the cube.
Eigen::Vector3d Gradient(const DenseGrid<DenseVoxel>& grid, const Eigen::Vector3d& q) {
  constexpr double kDelta = 1e-4;
  Eigen::Vector3d gradient;
  for (int a = 0; a < 3; ++a) {
    const double to_next = q[a] - std::floor(q[a]) < 0.5 ? kDelta : -kDelta;
    Eigen::Vector3d other = q;
    other[a] += to_next;
    gradient[a] = (Trilinear(grid, other).value() - Trilinear(grid, q).value()) / to_next;
  }
  return gradient;
}

}  // namespace

RayReference::RayReference(const MapRepresentation& map, Method method, const MapConfig& config,
                           const Box& box, const std::vector<InstanceId>& ids)
    : map_(map),
      config_(config),
      one_field_(IsOneField(method) || method == Method::kTsdfppLiteral),
      has_index_(method == Method::kTsdfpp || method == Method::kTsdfppAnchored) {
  for (const InstanceId id : ids) {
    const InstanceId key = one_field_ ? kBackground : id;
    auto field =
        fields_.try_emplace(key, Field{DenseGrid<DenseVoxel>(box), Pose::Identity()}).first;
    if (!one_field_) field->second.T_LW = map.ObjectLattice(id).inverse();
    for (const Eigen::Vector3i& v : VoxelsOf(map).ObservedVoxels(id)) {
      if (one_field_) {
        const auto list = VoxelsOf(map).ListAt(v);
        if (list.empty() || list.front().id != id) continue;
      }
      const VoxelValue value = VoxelsOf(map).ValueAt(id, v).value();
      field->second.grid.At(v).distance = value.distance_m;
      field->second.grid.At(v).weight = value.weight;
    }
  }
}

bool RayReference::Hidden(InstanceId id, const RayHit& hit, const Eigen::Vector3d& p_W,
                          const std::vector<InstanceId>& without) const {
  const double h = config_.voxel_m;
  const Eigen::Vector3d look_up_W = p_W + 0.5 * h * hit.normal_W;
  const Eigen::Vector3i v = (look_up_W / h).array().round().matrix().cast<int>();
  for (const Listing& entry : VoxelsOf(map_).ListAt(v)) {
    if (std::find(without.begin(), without.end(), entry.id) != without.end()) continue;
    if (entry.id == id) return false;
    const Field& active = fields_.at(entry.id);
    const auto distance = DistanceAt(active.grid, active.T_LW * look_up_W / h);
    return distance && *distance < -h;
  }
  return false;
}

bool RayReference::Knows(InstanceId id, const Eigen::Vector3d& p_W) const {
  const Field& field = fields_.at(one_field_ ? kBackground : id);
  return Trilinear(field.grid, field.T_LW * p_W / config_.voxel_m).has_value();
}

std::optional<RayHit> RayReference::Cast(const Intrinsics& camera, const Pose& T_WC, int u, int v,
                                         double far_m,
                                         const std::vector<InstanceId>& without) const {
  const double h = config_.voxel_m;
  const double step = kStep_voxels * h;
  const Eigen::Vector3d ray_W =
      T_WC.linear() * Eigen::Vector3d((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
  std::optional<RayHit> nearest;
  for (const auto& [id, field] : fields_) {
    if (std::find(without.begin(), without.end(), id) != without.end()) continue;
    const Eigen::Vector3d origin = field.T_LW * T_WC.translation() / h;
    const Eigen::Vector3d ray = field.T_LW.linear() * ray_W / h;
    const auto at = [&](double depth) { return Trilinear(field.grid, origin + depth * ray); };
    std::optional<double> before;
    double before_depth = 0;
    for (double depth = 0; depth < far_m && (!nearest || depth < nearest->depth); depth += step) {
      const auto now = at(depth);
      if (now && !before && depth > 0) {
        // Where the ray came out of the unobserved, halved often enough for a double.
        double unobserved = depth - step;
        before = now;
        before_depth = depth;
        for (int i = 0; i < 40; ++i) {
          const double middle = (unobserved + before_depth) / 2;
          if (const auto value = at(middle)) {
            before = value;
            before_depth = middle;
          } else {
            unobserved = middle;
          }
        }
      }
      if (before && now && *before >= 0 && *now < 0) {
        RayHit hit;
        hit.depth = before_depth + (depth - before_depth) * *before / (*before - *now);
        const Eigen::Vector3d p_W = T_WC.translation() + hit.depth * ray_W;
        const Eigen::Vector3d q = origin + hit.depth * ray;
        hit.normal_W = field.T_LW.linear().transpose() * Gradient(field.grid, q).normalized();
        hit.id = id;
        if (one_field_) {
          const auto list = VoxelsOf(map_).ListAt((p_W / h).array().round().matrix().cast<int>());
          hit.id = list.empty() ? kBackground : list.front().id;
        }
        if (!has_index_ || !Hidden(id, hit, p_W, without)) {
          if (!nearest || hit.depth < nearest->depth) nearest = hit;
          break;
        }
      }
      before = now;
      before_depth = depth;
    }
  }
  return nearest;
}

}  // namespace tsdfpp::reference
