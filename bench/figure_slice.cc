#include <array>

#include "bench/figure_runs.h"
#include "bench/figures.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

constexpr const char* kSliceScene = "scenes/mini.toml";
constexpr InstanceId kCar = 1;

struct Moment {
  const char* name;
  int frame;
};
constexpr std::array<Moment, 3> kMoments{{{"before", 5}, {"during", 23}, {"after", 48}}};

// The slice's voxels: across the car's way, where it is in the second moment.
constexpr int kHalfWidth_voxels = 16;
constexpr int kBelow_voxels = 8;
constexpr int kAbove_voxels = 14;

std::string DistanceCell(const MapRepresentation& map, InstanceId id, const Eigen::Vector3i& voxel,
                         double voxel_m) {
  const auto value = VoxelsOf(map).ValueAt(id, voxel);
  return value ? Cell(value->distance_m / voxel_m, 3) : std::string();
}

}  // namespace

Expected<void> MeasureSlice(const FigureOptions& options) {
  TSDFPP_ASSIGN(const Footage footage, Film({kSliceScene, 1, 1, kMoments.back().frame, {}}));
  const auto number = static_cast<std::size_t>(kMoments[1].frame - footage.info.first_index);
  const Pose& T_WO = footage.frames.at(number).T_WO.at(kCar);
  FigureTable table(
      {"map", "moment", "y", "z", "active", "inactive", "table voxels", "car voxels"});
  for (const Method method : {Method::kTsdf, Method::kTsdfpp}) {
    PipelineConfig config;
    config.method = method;
    TSDFPP_RETURN_IF_ERROR(config.map.SetProfile("paper"));
    const double h = config.map.voxel_m;
    const Eigen::Vector3i middle =
        (T_WO.translation() / h + Eigen::Vector3d::Constant(0.5)).array().floor().cast<int>();
    std::set<int> frames;
    for (const Moment& moment : kMoments) frames.insert(moment.frame);
    MapFootage(footage, config, frames, [&](int frame, const MapRepresentation& map) {
      const auto* moment = std::find_if(kMoments.begin(), kMoments.end(),
                                        [&](const Moment& m) { return m.frame == frame; });
      for (int z = -kBelow_voxels; z <= kAbove_voxels; ++z) {
        for (int y = -kHalfWidth_voxels; y <= kHalfWidth_voxels; ++y) {
          const Eigen::Vector3i voxel = middle + Eigen::Vector3i(0, y, z);
          const std::vector<Listing> list = VoxelsOf(map).ListAt(voxel);
          table.Add({std::string(MethodName(method)), moment->name, std::to_string(voxel.y()),
                     std::to_string(voxel.z()), list.empty() ? "" : std::to_string(list[0].id),
                     list.size() < 2 ? "" : std::to_string(list[1].id),
                     DistanceCell(map, kBackground, voxel, h), DistanceCell(map, kCar, voxel, h)});
        }
      }
    });
  }
  return table.Write(options.out, "slice");
}

}  // namespace tsdfpp
