// What the rays of a tile have met, written into images.
#pragma once

#include <vector>

#include "mapper/rays/ray_scene.h"

namespace tsdfpp {

// Images of the camera's size, one of each kind a surface; unset.
std::vector<RaySurface> MakeImages(const Intrinsics& camera, const RayCastOptions& options);

class TileImage {
 public:
  explicit TileImage(const RayScene& scene);

  // One surface of the tile at which `rays` is.
  void Write(const TileHits& hits, TileRaysOf& rays, RaySurface& out);

 private:
  InstanceId IdOf(const TileHits& hits, std::size_t i) const;
  template <int kCount>
  void WritePixels(const TileHits& hits, std::size_t i, int count, float* depth, float* normal,
                   std::uint16_t* id) const;
  void WriteLabels(const TileHits& hits, int columns, int rows, cv::Mat& ids);
  void WriteColours(const TileHits& hits, int columns, int rows, cv::Mat& colours);
  Colour ColourOf(std::size_t i, const TileHits& hits);

  const RayScene& scene_;
  TileRaysOf* rays_ = nullptr;  // during a call of Write()
  VoxelLabels labels_;
  std::array<Index3, kTilePixels> voxels_;  // by TileOrder
  std::array<InstanceId, kTilePixels> labelled_;
};

}  // namespace tsdfpp
