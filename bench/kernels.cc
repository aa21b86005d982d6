// The mapper's inner steps on a wall with a box before it, 960x540, 1 cm, truncation 10 voxels.
#include <benchmark/benchmark.h>

#include "mapper/map_representation.h"
#include "mapper/mesh/marching_cubes.h"
#include "mapper/volume/allocation.h"
#include "mapper/volume/pull_back.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {
namespace {

constexpr InstanceId kBox = 1;

Frame WallAndBox() {
  Frame frame;
  frame.index = 1;
  frame.intrinsics = {960, 540, 564.3, 564.3, 480, 270};
  const cv::Rect box(400, 200, 160, 140);
  frame.depth = cv::Mat(540, 960, CV_32FC1, cv::Scalar(1.5));
  frame.depth(box) = 1.2F;
  frame.mask = cv::Mat(540, 960, CV_16UC1, cv::Scalar(kBackground));
  frame.mask(box) = kBox;
  frame.colour = cv::Mat(540, 960, CV_8UC3, cv::Scalar(120, 130, 140));
  return frame;
}

MapConfig PaperConfig() {
  MapConfig config;
  config.trunc_back_voxels = config.trunc_front_voxels;
  return config;
}

ObjectVolumes FusedVolumes() {
  const Frame frame = WallAndBox();
  ObjectVolumes volumes;
  FuseIntoVolumes(FrameView(frame, frame.mask), PaperConfig(), volumes);
  return volumes;
}

void BlocksAlongRays(benchmark::State& state) {
  const Frame frame = WallAndBox();
  const FrameView view(frame, frame.mask);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        tsdfpp::BlocksAlongRays(view, PaperConfig(), [](InstanceId) { return LatticeOfLabel(); }));
  }
}
BENCHMARK(BlocksAlongRays)->Unit(benchmark::kMillisecond)->UseRealTime();

void FuseVolumes(benchmark::State& state) {
  const Frame frame = WallAndBox();
  const FrameView view(frame, frame.mask);
  ObjectVolumes volumes = FusedVolumes();
  for (auto _ : state) {
    benchmark::DoNotOptimize(FuseIntoVolumes(view, PaperConfig(), volumes));
  }
}
BENCHMARK(FuseVolumes)->Unit(benchmark::kMillisecond)->UseRealTime();

void ExtractWall(benchmark::State& state) {
  const ObjectVolumes volumes = FusedVolumes();
  for (auto _ : state) {
    benchmark::DoNotOptimize(ExtractMesh(volumes.at(kBackground).grid, 0.01F));
  }
}
BENCHMARK(ExtractWall)->Unit(benchmark::kMillisecond)->UseRealTime();

void ResampleBox(benchmark::State& state) {
  const ObjectVolumes volumes = FusedVolumes();
  Pose T_rel = Pose::Identity();
  T_rel.rotate(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY()));
  T_rel.translation().x() = 0.005;
  for (auto _ : state) {
    benchmark::DoNotOptimize(ResampleGrid(volumes.at(kBox).grid, T_rel, 0.01, 0.1F));
  }
}
BENCHMARK(ResampleBox)->Unit(benchmark::kMillisecond)->UseRealTime();

// Depth, normals and ids of the first surface, seen from where the frame was.
void CastRays(benchmark::State& state) {
  const Frame frame = WallAndBox();
  const auto map = MakeMap(Method::kTsdfpp, PaperConfig());
  map->Fuse(frame, frame.mask);
  RayCastOptions options;
  options.colour = false;
  for (auto _ : state) {
    benchmark::DoNotOptimize(map->CastRays(frame.intrinsics, frame.T_WC, options));
  }
}
BENCHMARK(CastRays)->Unit(benchmark::kMillisecond)->UseRealTime();

// A whole frame of a map whose box moves to and fro.
void MapFrame(benchmark::State& state, Method method) {
  const Frame frame = WallAndBox();
  const auto map = MakeMap(method, PaperConfig());
  map->Fuse(frame, frame.mask);
  Pose T_WO = Pose::Identity();
  map->SetObjectPose(kBox, T_WO);
  for (auto _ : state) {
    T_WO.translation().x() = 0.004 - T_WO.translation().x();
    map->SetObjectPose(kBox, T_WO);
    map->Fuse(frame, frame.mask);
  }
}
BENCHMARK_CAPTURE(MapFrame, tsdf, Method::kTsdf)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(MapFrame, tsdfpp, Method::kTsdfpp)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(MapFrame, literal, Method::kTsdfppLiteral)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(MapFrame, anchored, Method::kTsdfppAnchored)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace tsdfpp
