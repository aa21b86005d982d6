// Where a BOP dataset keeps its files (docs/sources.md, "BOP").
#pragma once

#include <fmt/format.h>

#include <string>

namespace tsdfpp::bop {

inline constexpr const char* kCamera = "scene_camera.json";
inline constexpr const char* kTruth = "scene_gt.json";
inline constexpr const char* kTruthInfo = "scene_gt_info.json";
inline constexpr const char* kModelsInfo = "models/models_info.json";
inline constexpr const char* kBackgroundModel = "models/background.ply";  // ours, world frame
inline constexpr int kMostObjects = 30000;  // obj_id and what follows are instance ids
// In one image; which instance continues which takes time with the square.
inline constexpr std::size_t kMostInstances = 1000;
inline constexpr double kMillimetres = 1000;  // in a metre

// Relative to the scene's folder: image and, in the image's list of scene_gt.json, instance.
inline std::string ImageFile(const char* folder, int image, const char* extension = "png") {
  return fmt::format("{}/{:06d}.{}", folder, image, extension);
}
inline std::string MaskFile(const char* folder, int image, int place) {
  return fmt::format("{}/{:06d}_{:06d}.png", folder, image, place);
}
// Relative to the dataset's folder.
inline std::string ModelFile(int obj_id) { return fmt::format("models/obj_{:06d}.ply", obj_id); }

}  // namespace tsdfpp::bop
