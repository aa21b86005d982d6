// Several threads read one map at once, each in another order and with a mesher of its own: each
// sees what one thread alone sees. Whether they meet while they read, TSan says
// (scripts/sanitizers.sh).
#include <gtest/gtest.h>

#include <barrier>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "mapper/map_file.h"
#include "mapper/map_query.h"
#include "mapper/scene_mesher.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/map_snapshot.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kThreads = 4;

using Reading = std::function<std::string(const MapRepresentation&)>;

std::string VoxelsAsBytes(const MapRepresentation& map) {
  const VoxelInspection& voxels = VoxelsOf(map);
  std::string bytes;
  for (const InstanceId id : ToyIds()) {
    if (const TsdfGrid* grid = voxels.GridOf(id)) AppendBytes(TsdfGrid(*grid).size(), bytes);
    for (const Eigen::Vector3i& v : voxels.ObservedVoxels(id)) {
      AppendBytes(voxels.ValueAt(id, v)->distance_m, bytes);
    }
  }
  return bytes;
}

std::string ListsAsBytes(const MapRepresentation& map) {
  std::string bytes;
  for (const Eigen::Vector3i& v : VoxelsOf(map).ListedVoxels()) {
    for (const Listing& entry : VoxelsOf(map).ListAt(v)) AppendBytes(entry.id, bytes);
  }
  return bytes;
}

std::string RaysAsBytes(const MapRepresentation& map) {
  const Frame frame = DriveFrame(0);
  RayCastOptions options;
  options.surfaces = 3;  // more than the lists of some methods know
  std::string bytes;
  for (const RaySurface& surface : map.CastRays(frame.intrinsics, frame.T_WC, options)) {
    for (const cv::Mat& image : {surface.depth, surface.id}) {
      bytes.append(reinterpret_cast<const char*>(image.data), image.total() * image.elemSize());
    }
  }
  return bytes;
}

std::string MeshesAsBytes(const MapRepresentation& map) {
  SceneMesher mesher;
  std::string bytes;
  AppendMesh(mesher.SceneMesh(map), bytes);
  for (const InstanceId id : map.Objects()) AppendMesh(mesher.ObjectMesh(map, id), bytes);
  for (const ScenePiece& piece : mesher.TakeSceneChanges(map).parts) AppendMesh(piece.mesh, bytes);
  return bytes;
}

std::string AnswersAsBytes(const MapRepresentation& map) {
  std::vector<Eigen::Vector3d> points_W;
  for (int i = 0; i < 2000; ++i) {
    points_W.emplace_back(0.02 * (i % 20) - 0.2, 0.02 * (i / 20 % 20) - 0.2, 0.02 * (i / 400));
  }
  std::string bytes;
  for (const PointAnswer& answer : MapQuery::Of(map).value().At(points_W)) {
    if (answer.visible) AppendBytes(answer.visible->distance_m, bytes);
    for (const SurfaceDistance& surface : answer.objects) AppendBytes(surface.id, bytes);
  }
  return bytes;
}

std::string CopyAsBytes(const MapRepresentation& map) {
  const auto copy = map.Clone();
  copy->Remove(kBrick);
  std::string bytes;
  AppendMesh(copy->SceneMesh(), bytes);
  return bytes;
}

std::string RestAsBytes(const MapRepresentation& map) {
  std::string bytes;
  AppendBytes(map.Memory().blocks, bytes);
  for (const InstanceId id : map.Objects()) AppendBytes(map.ObjectLattice(id).matrix(), bytes);
  if (map.persistence() != nullptr) bytes += MapToBytes(map).value();
  if (map.inspection() != nullptr) bytes += VoxelsOf(map).FindFault().value_or("well");
  return bytes;
}

// After poses alone, so that what is made when it is read is out of date.
std::unique_ptr<MapRepresentation> MapNotReadYet(Method method) {
  auto map = DrivenMap(method, ToyConfig(), 2);
  for (const auto& [id, T_WO] : DriveFrame(4).T_WO) map->SetObjectPose(id, T_WO);
  return map;
}

class ConcurrentReaders : public EveryMethodTest {};
TSDFPP_FOR_EVERY_METHOD(ConcurrentReaders);

TEST_P(ConcurrentReaders, SeeWhatOneSees) {
  std::vector<Reading> readings{RaysAsBytes, MeshesAsBytes, CopyAsBytes, RestAsBytes};
  if (InfoOf(GetParam()).has_voxels) {
    readings.insert(readings.end(), {VoxelsAsBytes, ListsAsBytes, AnswersAsBytes});
  }
  const auto map_of_one = MapNotReadYet(GetParam());
  std::vector<std::string> expected;
  for (const Reading& read : readings) expected.push_back(read(*map_of_one));
  for (std::size_t first = 0; first < readings.size(); ++first) {
    const auto map = MapNotReadYet(GetParam());
    std::barrier start(kThreads);
    std::vector<std::thread> threads;
    std::vector<std::vector<std::string>> seen(kThreads);
    for (std::size_t t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        seen[t].resize(readings.size());
        start.arrive_and_wait();
        for (std::size_t i = 0; i < readings.size(); ++i) {
          const std::size_t which = (first + t + i) % readings.size();
          seen[t][which] = readings[which](*map);
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    for (std::size_t t = 0; t < kThreads; ++t) {
      for (std::size_t which = 0; which < readings.size(); ++which) {
        ASSERT_GT(expected[which].size(), 0U) << "reading " << which;
        EXPECT_TRUE(seen[t][which] == expected[which]) << "reading " << which << ", thread " << t;
      }
    }
  }
}

}  // namespace
}  // namespace tsdfpp
