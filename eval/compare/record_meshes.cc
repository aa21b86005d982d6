#include "eval/compare/record_meshes.h"

#include <algorithm>
#include <cmath>

#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

constexpr float kNearTable_m = 0.15F;  // around the table's box counts as near

}  // namespace

std::pair<TriangleMesh, TriangleMesh> SplitByBox(const TriangleMesh& mesh,
                                                 const Eigen::AlignedBox3f& box) {
  TriangleMesh inside{mesh.vertices, {}, mesh.colours, {}};
  TriangleMesh outside = inside;
  for (const auto& triangle : mesh.triangles) {
    (box.contains(mesh.vertices[triangle[0]]) ? inside : outside).triangles.push_back(triangle);
  }
  return {std::move(inside), std::move(outside)};
}

Eigen::AlignedBox3f TableBox(const SceneTruth& truth) {
  Eigen::AlignedBox3f box;
  const TrueModel& room = truth.surface(0).model();
  for (std::size_t t = 0; t < room.mesh_O.triangles.size(); ++t) {
    if (room.regions[room.face_region[t]] != kTableRegion) continue;
    for (int corner = 0; corner < 3; ++corner) box.extend(Corner(room.mesh_O, t, corner));
  }
  if (box.isEmpty()) return box;
  const auto margin = Eigen::Vector3f::Constant(kNearTable_m);
  return {box.min() - margin, box.max() + margin};
}

TriangleMesh HoleMesh(const SceneTruth& truth, const Selection& reconstructed) {
  constexpr float kHalfSide = 0.65F;  // of a sample's share
  constexpr float kInFront_m = 0.001F;
  const SeenTracker& tracker = truth.trackers().front();
  const SampleSet& samples = tracker.samples_O();
  const std::vector<std::string>& regions = truth.surface(0).model().regions;
  const bool has_table = std::find(regions.begin(), regions.end(), kTableRegion) != regions.end();
  TriangleMesh mesh;
  for (std::size_t i = 0; i < reconstructed.size(); ++i) {
    if (reconstructed[i] != 0 || !tracker.Seen(i) ||
        tracker.status()[i] != SampleStatus::kBehindOther ||
        (has_table && regions[samples.region[i]] != kTableRegion)) {
      continue;
    }
    const Eigen::Vector3f& n = samples.normals[i];
    const Eigen::Vector3f right = n.unitOrthogonal() * kHalfSide * std::sqrt(samples.area_m2[i]);
    const Eigen::Vector3f up = n.cross(right);
    const Eigen::Vector3f middle = samples.points[i] + kInFront_m * n;
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
      const Eigen::Vector3f corner =
          middle + static_cast<float>(x) * right + static_cast<float>(y) * up;
      mesh.vertices.push_back((truth.T_WO(0) * corner.cast<double>()).cast<float>());
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
  }
  return mesh;
}

}  // namespace tsdfpp
