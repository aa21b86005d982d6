// The pose of one car-sized object: its values resampled, or its index alone moved.
#include <array>
#include <map>

#include "bench/clocks.h"
#include "bench/figure_runs.h"
#include "bench/scaling.h"
#include "bench/scaling_runs.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

constexpr int kPosesFrames = 96;
constexpr int kFirstMove = 24;  // frame number; both cars drive

struct Way {
  const char* name;
  Method method;
  bool refresh;  // and bring the index up to date, which fusion would otherwise do
};
constexpr std::array<Way, 3> kWays{
    {{"tsdf++", Method::kTsdfpp, false},
     {"tsdf++/anchored", Method::kTsdfppAnchored, false},
     {"tsdf++/anchored and its index", Method::kTsdfppAnchored, true}}};
struct Car {
  InstanceId id;
  const char* name;
};
constexpr std::array<Car, 2> kCars{{{1, "truck"}, {2, "car"}}};

}  // namespace

Expected<void> MeasurePoses(const ScalingOptions& options) {
  TSDFPP_ASSIGN(const Footage footage, Film({kMovingScene, 1, 1, kPosesFrames, {}}));
  TSDFPP_ASSIGN(const MapConfig config, ScalingConfig());
  FigureTable table({"map", "object", "blocks", "median ms", "p99 ms", "worst ms", "CPU ms"});
  for (const Way& way : kWays) {
    std::map<InstanceId, std::vector<Times>> wall;
    std::map<InstanceId, std::vector<Times>> cpu;
    std::map<InstanceId, std::size_t> blocks;
    for (int run = 0; run < options.runs; ++run) {
      for (const Car& car : kCars) {
        wall[car.id].emplace_back();
        cpu[car.id].emplace_back();
      }
      const auto map = MakeMap(way.method, config);
      for (const Frame& frame : footage.frames) {
        for (const auto& [id, T_WO] : frame.T_WO) {
          const double start = WallMilliseconds();
          const double cpu_start = CpuMilliseconds();
          map->SetObjectPose(id, T_WO);
          if (way.refresh) VoxelsOf(*map).ListAt(Eigen::Vector3i::Zero());
          if (frame.index < kFirstMove || !wall.contains(id)) continue;
          wall[id].back().ms.push_back(WallMilliseconds() - start);
          cpu[id].back().ms.push_back(CpuMilliseconds() - cpu_start);
        }
        map->Fuse(frame, frame.mask);
      }
      for (const Car& car : kCars) blocks[car.id] = VoxelsOf(*map).GridOf(car.id)->size();
    }
    for (const Car& car : kCars) {
      const Times least = LeastOf(wall[car.id]);
      table.Add({way.name, car.name, std::to_string(blocks[car.id]), Cell(least.Median(), 2),
                 Cell(least.Quantile(0.99), 2), Cell(least.Worst(), 2),
                 Cell(LeastOf(cpu[car.id]).Median(), 2)});
    }
  }
  return table.Write(options.out, "poses");
}

}  // namespace tsdfpp
