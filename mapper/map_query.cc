#include "mapper/map_query.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "mapper/volume/object_volume.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kPointsPerTask = 256;
// Further out no voxel is, and indices stay far from the ends of their 21 bits.
constexpr double kFurthestVoxel = double{kBlockSide} * (kFurthestBlock + 1);

std::size_t At8(int i) { return static_cast<std::size_t>(i); }

// The derivative of the trilinear interpolant, a voxel.
Eigen::Vector3d TrilinearGradient(const std::array<float, 8>& corner,
                                  const std::array<float, 3>& fraction) {
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (int i = 0; i < 8; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      double slope = ((i >> axis) & 1) != 0 ? 1 : -1;
      for (int other = 0; other < 3; ++other) {
        if (other == axis) continue;
        const double f = fraction[At8(other)];
        slope *= ((i >> other) & 1) != 0 ? f : 1 - f;
      }
      gradient[axis] += slope * static_cast<double>(corner[At8(i)]);
    }
  }
  return gradient;
}

}  // namespace

struct MapQuery::Object {
  InstanceId id;
  VoxelReader reader;
  Pose T_LW;
  Eigen::Matrix3d R_WL;
};

Expected<MapQuery> MapQuery::Of(const MapRepresentation& map) {
  TSDFPP_ASSIGN(const VoxelInspection* voxels, AskForVoxels(map, "a question about a point"));
  return MapQuery(map, *voxels);
}

MapQuery::MapQuery(const MapRepresentation& map, const VoxelInspection& voxels)
    : voxels_(&voxels), voxel_m_(map.config().voxel_m), one_field_(IsOneField(map.method())) {
  const std::vector<InstanceId> ids =
      one_field_ ? std::vector<InstanceId>{kBackground} : map.Objects();
  std::vector<Object> objects;
  for (const InstanceId id : ids) {
    const Pose T_WL = map.ObjectLattice(id);
    objects.push_back({id, VoxelReader(*voxels.GridOf(id)), T_WL.inverse(), T_WL.linear()});
  }
  objects_ = std::make_shared<const std::vector<Object>>(std::move(objects));
}

std::optional<SurfaceDistance> MapQuery::Ask(const Object& object,
                                             const Eigen::Vector3d& p_W) const {
  const Eigen::Vector3d q = object.T_LW * p_W / voxel_m_;
  const bool is_near = q.cwiseAbs().maxCoeff() < kFurthestVoxel;
  if (!is_near || object.reader.empty()) return std::nullopt;
  const Corners corners = FindCorners(object.reader, q);
  std::array<float, 8> distance{};
  std::array<float, 8> weight{};
  for (std::size_t i = 0; i < 8; ++i) {
    if (corners.block[i] == nullptr) return std::nullopt;
    const auto place = static_cast<std::size_t>(corners.place[i]);
    distance[i] = corners.block[i]->distance[place];
    weight[i] = corners.block[i]->weight[place];
    if (!(weight[i] > 0)) return std::nullopt;
  }
  SurfaceDistance surface;
  surface.id = object.id;
  surface.distance_m = Trilinear(distance, corners.fraction);
  surface.weight = Trilinear(weight, corners.fraction);
  const Eigen::Vector3d gradient_L = TrilinearGradient(distance, corners.fraction) / voxel_m_;
  surface.gradient_W = (object.R_WL * gradient_L).cast<float>();
  return surface;
}

PointAnswer MapQuery::At(const Eigen::Vector3d& p_W) const {
  PointAnswer answer;
  if (!p_W.allFinite()) return answer;
  for (const Object& object : *objects_) {
    if (auto surface = Ask(object, p_W)) answer.objects.push_back(*surface);
  }
  if (answer.objects.empty()) return answer;
  std::sort(answer.objects.begin(), answer.objects.end(),
            [](const SurfaceDistance& a, const SurfaceDistance& b) {
              return a.distance_m != b.distance_m ? a.distance_m < b.distance_m : a.id < b.id;
            });
  const Index3 nearest = FloorOf(p_W / voxel_m_ + Eigen::Vector3d::Constant(0.5));
  const std::vector<Listing> list = voxels_->ListAt({nearest.x, nearest.y, nearest.z});
  if (one_field_) answer.objects[0].id = list.empty() ? kBackground : list[0].id;
  answer.visible = answer.objects[0];
  if (list.empty()) return answer;
  for (const SurfaceDistance& surface : answer.objects) {
    if (surface.id == list[0].id) answer.visible = surface;
  }
  return answer;
}

std::vector<PointAnswer> MapQuery::At(const std::vector<Eigen::Vector3d>& points_W) const {
  std::vector<PointAnswer> answers(points_W.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, points_W.size(), kPointsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) answers[i] = At(points_W[i]);
      },
      tbb::simple_partitioner());
  return answers;
}

}  // namespace tsdfpp
