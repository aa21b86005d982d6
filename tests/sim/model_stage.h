// Models on the room's table, rendered as any scene is.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "sim/render/renderer.h"
#include "sim/scene/scene_builder.h"

namespace tsdfpp {

// Looks along +z from `eye` at `target`, x level.
inline Pose LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - eye).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose T_WC = Pose::Identity();
  T_WC.linear() << x, z.cross(x), z;
  T_WC.translation() = eye;
  return T_WC;
}

struct ModelStage {
  SceneConfig config;
  std::unique_ptr<CompiledScene> scene;
  std::unique_ptr<Renderer> renderer;
  std::string error;  // why there is no scene; empty: there is one

  // The models beside one another on the table, `gap_m` between their middles, ids 1, 2, ...
  ModelStage(const std::vector<ModelSpec>& models, double gap_m, int width, int height,
             const RoomSpec& room = {}, const LightRig& lights = DefaultLightRig()) {
    config.name = "stage";
    config.intrinsics = {
        width, height, 1.2 * width, 1.2 * width, (width - 1) / 2.0, (height - 1) / 2.0};
    config.room = room;
    config.lights = lights;
    std::map<InstanceId, Pose> poses;
    const auto columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(models.size()))));
    for (std::size_t i = 0; i < models.size(); ++i) {
      SceneObject object;
      object.id = static_cast<InstanceId>(i + 1);
      object.name = "object_" + std::to_string(i + 1);
      object.model = models[i];
      const int column = static_cast<int>(i) % columns;
      const int row = static_cast<int>(i) / columns;
      const auto rows = (static_cast<int>(models.size()) + columns - 1) / columns;
      Pose T_WO = Pose::Identity();
      T_WO.translation() = Eigen::Vector3d(gap_m * (column - (columns - 1) / 2.0),
                                           gap_m * (row - (rows - 1) / 2.0), room.ground_m());
      poses.emplace(object.id, T_WO);
      config.objects.push_back(object);
    }
    auto compiled = CompiledScene::Compile(config);
    if (!compiled) {
      error = compiled.error().message;
      return;
    }
    scene = std::make_unique<CompiledScene>(std::move(*compiled));
    scene->SetPoses(poses);
    auto made = Renderer::Create(*scene, config.intrinsics);
    if (!made) {
      error = made.error().message;
      return;
    }
    renderer = std::move(*made);
  }

  // Towards the middle of the models, from `azimuth_deg` (from +x towards +y).
  RenderedImages Render(double azimuth_deg, double distance_m, double height_m,
                        double target_height_m, bool with_colour) {
    T_WC = View(azimuth_deg, distance_m, height_m, target_height_m);
    auto images = renderer->Render(T_WC, with_colour);
    EXPECT_TRUE(images.has_value()) << images.error().message;
    return images.has_value() ? std::move(*images) : RenderedImages{};
  }

  Pose View(double azimuth_deg, double distance_m, double height_m, double target_height_m) const {
    const double ground = config.room.ground_m();
    const double azimuth = azimuth_deg * std::numbers::pi / 180;
    return LookAt(
        {distance_m * std::cos(azimuth), distance_m * std::sin(azimuth), ground + height_m},
        {0, 0, ground + target_height_m});
  }

  Pose T_WC = Pose::Identity();  // of the picture rendered last
};

}  // namespace tsdfpp
