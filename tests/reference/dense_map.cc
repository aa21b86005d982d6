#include "tests/reference/dense_map.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace tsdfpp::reference {

std::optional<Pose> PoseBook::Update(InstanceId id, const Pose& T_WO) {
  const auto found = poses_.find(id);
  if (found == poses_.end()) {
    poses_.emplace(id, Poses{T_WO, T_WO});
    return std::nullopt;
  }
  const Pose old = found->second.now;
  if (old.matrix() == T_WO.matrix()) return std::nullopt;
  found->second.now = T_WO;
  return T_WO * old.inverse();
}

Pose PoseBook::Lattice(InstanceId id) const {
  const auto found = poses_.find(id);
  if (found == poses_.end()) return Pose::Identity();
  const auto& [birth, now] = found->second;
  if (birth.matrix() == now.matrix()) return Pose::Identity();
  return now * birth.inverse();
}

std::unique_ptr<DenseMap> MakeDenseMap(Method method, const MapConfig& config, const Box& box) {
  switch (method) {
    case Method::kTsdf:
    case Method::kTsdfMin:
    case Method::kTsdfGuarded:
    case Method::kTsdfStatic:
      return MakeDenseTsdf(method, config, box);
    case Method::kTsdfpp:
      return MakeDenseTsdfpp(config, box);
    case Method::kTsdfppLiteral:
      return MakeDenseLiteral(config, box);
    case Method::kTsdfppAnchored:
    case Method::kVolumes:
      return MakeDenseAnchored(config, box, LayersOf(method, config));
    default:
      if (!InfoOf(method).has_voxels) return nullptr;
      std::fprintf(stderr, "MakeDenseMap: method '%s' has no reference yet (CONTRIBUTING.md)\n",
                   std::string(MethodName(method)).c_str());
      std::abort();
  }
}

std::optional<VoxelValue> AsValue(const DenseVoxel& voxel) {
  if (!voxel.observed()) return std::nullopt;
  return VoxelValue{voxel.distance, voxel.weight, voxel.Rounded()};
}

void TakeOff(InstanceId id, List& list) {
  std::erase_if(list, [id](const Listing& entry) { return entry.id == id; });
}

bool IsListed(InstanceId id, const List& list) {
  return std::any_of(list.begin(), list.end(),
                     [id](const Listing& entry) { return entry.id == id; });
}

std::vector<Eigen::Vector3i> NonEmpty(const DenseGrid<List>& lists) {
  std::vector<Eigen::Vector3i> voxels;
  ForEachVoxel(lists.box(), [&](const Eigen::Vector3i& v) {
    if (!lists(v).empty()) voxels.push_back(v);
  });
  return voxels;
}

}  // namespace tsdfpp::reference
