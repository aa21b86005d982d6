// The true models are the surfaces that were rendered.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "core/random.h"
#include "tests/sim/scene_files.h"

namespace tsdfpp {
namespace {

// Depth is a float of some 1.5 m after a 24-bit raster step; the compiled vertices are floats too.
constexpr double kOnSurface_m = 2e-4;

// The distance from p to a triangle (Ericson, Real-Time Collision Detection, 5.1.5, by regions).
double DistanceToTriangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                          const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a;
  const Eigen::Vector3d ac = c - a;
  const Eigen::Vector3d n = ab.cross(ac);
  if (n.squaredNorm() > 0) {
    // Inside the prism over the triangle the plane is nearest.
    const bool inside = n.dot(ab.cross(p - a)) >= 0 && n.dot((c - b).cross(p - b)) >= 0 &&
                        n.dot((a - c).cross(p - c)) >= 0;
    if (inside) return std::abs(n.normalized().dot(p - a));
  }
  const auto to_edge = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& along) {
    const double length2 = along.squaredNorm();
    const double t = length2 > 0 ? std::clamp((p - from).dot(along) / length2, 0.0, 1.0) : 0.0;
    return (p - from - t * along).norm();
  };
  return std::min({to_edge(a, ab), to_edge(b, c - b), to_edge(c, a - c)});
}

double DistanceToMesh(const Eigen::Vector3d& p, const TriangleMesh& mesh) {
  double distance = std::numeric_limits<double>::infinity();
  for (const auto& [i, j, k] : mesh.triangles) {
    distance = std::min(distance, DistanceToTriangle(p, mesh.vertices[i].cast<double>(),
                                                     mesh.vertices[j].cast<double>(),
                                                     mesh.vertices[k].cast<double>()));
  }
  return distance;
}

TEST(Truth, RenderedPointsLieOnTheModelOfTheirId) {
  const auto source = OpenConfig(LoadScene("toycar3"));
  const auto models = source->Truth();
  ASSERT_TRUE(models.has_value());
  constexpr int kPointsPerId = 150;
  constexpr std::uint64_t kSeed = 1;
  for (const int index : {1, 200, 256}) {
    const auto frame = source->Read(index);
    ASSERT_TRUE(frame.has_value()) << frame.error().message;
    std::map<InstanceId, int> count;
    std::map<InstanceId, double> worst;
    for (std::uint64_t draw = 0; draw < 400000; ++draw) {
      const auto random = UniformDraw(kSeed, 0, draw, static_cast<std::uint32_t>(index));
      const int u = static_cast<int>(random[0] * frame->depth.cols);
      const int v = static_cast<int>(random[1] * frame->depth.rows);
      const InstanceId id = frame->mask.at<InstanceId>(v, u);
      if (count[id] >= kPointsPerId) continue;
      ++count[id];
      const double z = frame->depth.at<float>(v, u);
      const Eigen::Vector3d p_W = frame->T_WC * (z * RayOf(frame->intrinsics, u, v));
      const Eigen::Vector3d p_O = id == kBackground ? p_W : frame->T_WO.at(id).inverse() * p_W;
      const auto model = std::find_if(models->begin(), models->end(),
                                      [&](const TrueModel& m) { return m.info.id == id; });
      ASSERT_NE(model, models->end());
      worst[id] = std::max(worst[id], DistanceToMesh(p_O, model->mesh_O));
    }
    for (const ObjectInfo& object : source->info().objects) {
      EXPECT_EQ(count[object.id], kPointsPerId) << object.name << " in frame " << index;
      EXPECT_LT(worst[object.id], kOnSurface_m) << object.name << " in frame " << index;
    }
  }
}

TEST(Truth, ModelsCarryIdsRegionsAndColours) {
  const auto source = OpenConfig(LoadScene("toycar3"));
  const auto models = source->Truth();
  ASSERT_TRUE(models.has_value());
  ASSERT_EQ(models->size(), 7U);
  const TrueModel& background = models->front();
  EXPECT_EQ(background.info.id, kBackground);
  EXPECT_EQ(background.regions, (std::vector<std::string>{"table", "floor", "wall", "furniture"}));
  for (const TrueModel& model : *models) {
    const TriangleMesh& mesh = model.mesh_O;
    EXPECT_EQ(mesh.colours.size(), mesh.vertices.size());
    ASSERT_EQ(mesh.face_ids.size(), mesh.triangles.size());
    ASSERT_EQ(model.face_region.size(), mesh.triangles.size());
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
      ASSERT_EQ(mesh.face_ids[f], model.info.id);
      ASSERT_LT(model.face_region[f], model.regions.size());
      for (const std::uint32_t v : mesh.triangles[f]) ASSERT_LT(v, mesh.vertices.size());
    }
    // The volume that outward triangles enclose is positive.
    double six_volumes = 0;
    for (const auto& [a, b, c] : mesh.triangles) {
      six_volumes += mesh.vertices[a].cast<double>().dot(
          mesh.vertices[b].cast<double>().cross(mesh.vertices[c].cast<double>()));
    }
    EXPECT_GT(six_volumes, 0) << model.info.name;
  }
  EXPECT_EQ((*models)[1].info.name, "truck");
  EXPECT_EQ((*models)[1].regions, std::vector<std::string>{"truck"});
}

}  // namespace
}  // namespace tsdfpp
