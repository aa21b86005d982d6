// A world of boxes whose scores can be said by hand: a table on a floor, a house that stands still,
// a car and a cup that move once.
#pragma once

#include <utility>
#include <vector>

#include "core/frame_source.h"
#include "tests/metrics/test_scenes.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp::test {

inline constexpr InstanceId kCar = 1;
inline constexpr InstanceId kHouse = 2;
inline constexpr InstanceId kCup = 3;
inline constexpr int kJump = 5;  // from this frame on car and cup are elsewhere
inline constexpr int kFrames = 8;

// Half sides; the table's top is z = 0, and all stand on it.
inline const Eigen::Vector3f kTableHalf_m(0.30F, 0.25F, 0.02F);
inline const Eigen::Vector3f kFloorHalf_m(0.5F, 0.5F, 0.02F);
inline const Eigen::Vector3f kFloorCentre_W(0, 0, -0.42F);
inline Eigen::Vector3f HalfOf(InstanceId id) {
  return id == kCar     ? Eigen::Vector3f(0.06F, 0.04F, 0.03F)
         : id == kHouse ? Eigen::Vector3f(0.04F, 0.04F, 0.05F)
                        : Eigen::Vector3f(0.03F, 0.03F, 0.04F);
}

inline Eigen::Vector3f CentreAt(InstanceId id, int frame) {
  const bool after = frame >= kJump;
  const float z = HalfOf(id).z();
  if (id == kCar) return after ? Eigen::Vector3f(0.1F, -0.02F, z) : Eigen::Vector3f(-0.15F, 0, z);
  if (id == kCup) return after ? Eigen::Vector3f(0.2F, 0.1F, z) : Eigen::Vector3f(-0.2F, -0.15F, z);
  return {-0.05F, 0.15F, z};
}

// The faces of a box, each `grown_m` farther out.
inline TriangleMesh BoxAround(const Eigen::Vector3f& centre, const Eigen::Vector3f& half_m,
                              InstanceId id, float grown_m = 0) {
  const Eigen::Vector3f reach = half_m + Eigen::Vector3f::Constant(grown_m);
  TriangleMesh mesh = testing::Box(centre - reach, centre + reach);
  testing::Label(mesh, id);
  return mesh;
}
inline TriangleMesh TableMesh(InstanceId id = kBackground, float grown_m = 0) {
  return BoxAround({0, 0, -kTableHalf_m.z()}, kTableHalf_m, id, grown_m);
}
inline TriangleMesh FloorMesh(float up_m = 0) {
  return BoxAround(kFloorCentre_W + Eigen::Vector3f(0, 0, up_m), kFloorHalf_m, kBackground);
}
inline TriangleMesh ObjectMesh(InstanceId id, int frame, float grown_m = 0) {
  return BoxAround(CentreAt(id, frame), HalfOf(id), id, grown_m);
}
inline TriangleMesh Together(const std::vector<TriangleMesh>& parts) {
  TriangleMesh all;
  for (const TriangleMesh& part : parts) testing::Append(all, part);
  return all;
}

class TableWorld : public FrameSource {
 public:
  TableWorld() {
    info_.name = "table";
    info_.intrinsics = {160, 120, 140.0, 140.0, 79.5, 59.5};
    info_.frame_count = kFrames;
    info_.objects = {{kBackground, "background", "background"},
                     {kCar, "car", "car"},
                     {kHouse, "house", "house"},
                     {kCup, "cup", "cup"}};
  }

  const SequenceInfo& info() const override { return info_; }

  Expected<Frame> Read(int index) override {
    reference::Scene scene;
    const auto add = [&](InstanceId id, const Eigen::Vector3f& centre,
                         const Eigen::Vector3f& half) {
      Pose place = Pose::Identity();
      place.translation() = centre.cast<double>();
      const bool still = id == kBackground;
      scene.shapes.push_back(reference::Cuboid(
          id, {100, 100, 100}, still ? place : Pose::Identity(), half.cast<double>()));
      if (!still) scene.T_WO[id] = place;
    };
    add(kBackground, {0, 0, -kTableHalf_m.z()}, kTableHalf_m);
    add(kBackground, kFloorCentre_W, kFloorHalf_m);
    for (const InstanceId id : {kCar, kHouse, kCup}) add(id, CentreAt(id, index), HalfOf(id));
    return reference::Render(scene, reference::LookAt({0, -0.55, 0.55}, {0, 0, 0}), index,
                             info_.intrinsics);
  }

  // Not in the order of the ids. The table is the background's second region.
  Expected<std::vector<TrueModel>> Truth() override {
    std::vector<TrueModel> models;
    for (const InstanceId id : {kCup, kHouse, kCar}) {
      models.push_back(testing::Model(id, BoxAround(Eigen::Vector3f::Zero(), HalfOf(id), id)));
      models.back().info = info_.objects[id];
    }
    TrueModel background = testing::Model(kBackground, Together({FloorMesh(), TableMesh()}));
    background.info = info_.objects[kBackground];
    background.regions = {"floor", "table"};
    for (std::size_t t = background.face_region.size() / 2; t < background.face_region.size();
         ++t) {
      background.face_region[t] = 1;
    }
    models.push_back(std::move(background));
    return models;
  }

  SequenceInfo info_;
};

}  // namespace tsdfpp::test
