#include "bench/mesh.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <optional>

#include "bench/median.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/adapters/voxel_block_grid.h"
#include "eval/run/open_source.h"
#include "mapper/pipeline.h"
#include "mapper/scene_mesher.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

constexpr int kRepeats = 5;                       // of a mesh from scratch at the end
constexpr int kSmallChanges = 15;                 // at the end
constexpr std::array<int, 2> kBlockSides{8, 16};  // of VoxelBlockGrid, voxels

template <typename Function>
double MillisecondsOf(const Function& function) {
  const auto start = std::chrono::steady_clock::now();
  function();
  return 1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double ResidentMegabytes() {
  std::ifstream statm("/proc/self/statm");
  double size = 0;
  double resident = 0;
  statm >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// Kept meshes, an update each.
struct KeptTimes {
  std::vector<double> share;       // of changed blocks
  std::vector<double> index_ms;    // the index, where it is brought up to date when it is needed
  std::vector<double> update_ms;   // of the parts
  std::vector<double> changes_ms;  // and the changed ones for somebody who follows the scene
  std::vector<double> all_ms;      // with joining all parts to one mesh
  // Where a copy was meshed from scratch beside it: kept over (scratch times share).
  std::vector<double> whole_ms;
  std::vector<double> update_ratio;
  std::vector<double> changes_ratio;
  std::vector<double> all_ratio;

  void Measure(const MapRepresentation& map, SceneMesher& mesher, bool also_whole);
  void Print(const std::string& name) const;
};

void KeptTimes::Measure(const MapRepresentation& map, SceneMesher& mesher, bool also_whole) {
  index_ms.push_back(MillisecondsOf([&] {
    if (const VoxelInspection* voxels = map.inspection()) voxels->ListAt(Eigen::Vector3i::Zero());
  }));
  MeshWork work;
  update_ms.push_back(MillisecondsOf([&] { work = mesher.Update(map); }));
  changes_ms.push_back(update_ms.back() + MillisecondsOf([&] { mesher.TakeSceneChanges(map); }));
  all_ms.push_back(changes_ms.back() + MillisecondsOf([&] { mesher.SceneMesh(map); }));
  share.push_back(static_cast<double>(work.changed) / static_cast<double>(work.blocks));
  if (!also_whole) return;
  SceneMesher from_scratch;
  whole_ms.push_back(MillisecondsOf([&] { from_scratch.SceneMesh(map); }));
  const double fair_ms = whole_ms.back() * share.back();
  update_ratio.push_back(update_ms.back() / fair_ms);
  changes_ratio.push_back(changes_ms.back() / fair_ms);
  all_ratio.push_back(all_ms.back() / fair_ms);
}

void KeptTimes::Print(const std::string& name) const {
  std::printf("%-16s %8.3f %8.1f %8.2f %8.2f %8.2f %8.2f %8.2f %8.2f %8.2f\n", name.c_str(),
              Median(share), Median(whole_ms), Median(index_ms), Median(update_ms),
              Median(update_ratio), Median(changes_ms), Median(changes_ratio), Median(all_ms),
              Median(all_ratio));
}

// One method's map and what was measured of it.
struct Run {
  std::string name;
  std::unique_ptr<Pipeline> pipeline;
  SceneMesher mesher;  // of its map
  double growth_mb = 0;
  KeptTimes frames;  // of the run
  KeptTimes small;   // of frames that show one object alone
};

// The labels of the object that fills the most pixels, the background apart; nothing else.
cv::Mat LargestObjectAlone(const Frame& frame) {
  std::map<InstanceId, int> pixels;
  for (int v = 0; v < frame.mask.rows; ++v) {
    for (int u = 0; u < frame.mask.cols; ++u) ++pixels[frame.mask.at<InstanceId>(v, u)];
  }
  InstanceId largest = kNoInstance;
  for (const auto& [id, count] : pixels) {
    if (id == kBackground || id == kNoInstance) continue;
    if (largest == kNoInstance || count > pixels[largest]) largest = id;
  }
  cv::Mat labels(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
  labels.setTo(cv::Scalar(largest), frame.mask == static_cast<double>(largest));
  return labels;
}

// The child prints "milliseconds triangles bytes growth_mb" of VoxelBlockGrid.
struct ChildResult {
  std::string name;
  double mesh_ms = 0;
  double triangles = 0;
  double bytes = 0;
  double growth_mb = 0;
  bool finished = false;
};

ChildResult AskChild(const MeshBenchOptions& options, int block_side) {
  constexpr int kLimit_s = 600;
  std::array<char, 4096> self{};
  const ssize_t length = readlink("/proc/self/exe", self.data(), self.size() - 1);
  ChildResult result;
  result.name = fmt::format("Open3D VoxelBlockGrid {}", block_side);
  if (length <= 0) return result;
  const std::string command = fmt::format(
      "timeout {} '{}' voxel-block-grid --scene '{}' --open3d-band {} --voxel {} --frames {} "
      "--threads {} --block-side {} 2>/dev/null",
      kLimit_s, self.data(), options.scene, options.open3d_band, options.voxel_m, options.frames,
      options.threads, block_side);
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return result;
  const int read = std::fscanf(pipe, "%lf %lf %lf %lf", &result.mesh_ms, &result.triangles,
                               &result.bytes, &result.growth_mb);
  result.finished = pclose(pipe) == 0 && read == 4;
  return result;
}

void PrintMeshing(const std::vector<Run>& runs, const std::vector<double>& final_ms,
                  const std::vector<std::size_t>& triangles, const Open3dVolume::Mesh& scalable,
                  const std::vector<ChildResult>& grids) {
  std::printf("\nvisible scene from scratch, the last frame\n%-28s %10s %10s %12s\n", "",
              "triangles", "ms", "over Open3D");
  const double scalable_ms = 1e3 * scalable.seconds;
  double peer_ms = scalable_ms;  // the fastest
  for (const ChildResult& grid : grids) {
    if (grid.finished) peer_ms = std::min(peer_ms, grid.mesh_ms);
  }
  std::printf("%-28s %10zu %10.1f %12.3f\n", "Open3D ScalableTSDFVolume", scalable.triangles,
              scalable_ms, scalable_ms / peer_ms);
  for (const ChildResult& grid : grids) {
    if (grid.finished) {
      std::printf("%-28s %10.0f %10.1f %12.3f\n", grid.name.c_str(), grid.triangles, grid.mesh_ms,
                  grid.mesh_ms / peer_ms);
    } else {
      std::printf("%-28s %10s\n", grid.name.c_str(), "aborted");
    }
  }
  for (std::size_t m = 0; m < runs.size(); ++m) {
    std::printf("%-28s %10zu %10.1f %12.3f\n", runs[m].name.c_str(), triangles[m], final_ms[m],
                final_ms[m] / peer_ms);
  }
  const auto print_kept = [&](const char* title, KeptTimes Run::*times) {
    std::printf(
        "\nkept meshes, %s; ms, medians; ratios are over (from scratch x share of changed blocks)\n"
        "%-16s %8s %8s %8s %8s %8s %8s %8s %8s %8s\n",
        title, "", "share", "scratch", "index", "update", "ratio", "+ taking", "ratio", "+ joining",
        "ratio");
    for (const Run& run : runs) (run.*times).Print(run.name);
  };
  print_kept("frame by frame", &Run::frames);
  print_kept("the last frame's largest object observed alone", &Run::small);
  std::printf("(taking: of the parts that changed)\n");
}

void PrintMemory(const std::vector<Run>& runs, const Open3dVolume& peer, double peer_growth_mb,
                 const std::vector<ChildResult>& grids) {
  std::printf("\nmemory, MB\n%-28s %14s %10s %10s\n", "", "occupied blocks", "growth", "meshes");
  std::printf("%-28s %14.1f %10.1f %10s\n", "Open3D ScalableTSDFVolume",
              static_cast<double>(peer.OccupiedBytes()) / 1e6, peer_growth_mb, "-");
  for (const ChildResult& grid : grids) {
    if (!grid.finished) continue;
    std::printf("%-28s %14.1f %10.1f %10s\n", grid.name.c_str(), grid.bytes / 1e6, grid.growth_mb,
                "-");
  }
  for (const Run& run : runs) {
    const MapMemory memory = run.pipeline->map().Memory();
    std::printf("%-28s %14.1f %10.1f %10.1f\n", run.name.c_str(),
                static_cast<double>(memory.bytes) / 1e6, run.growth_mb,
                static_cast<double>(run.mesher.Bytes() + memory.derived_bytes) / 1e6);
  }
  std::printf(
      "(occupied blocks: with lists and tables; growth: of the process, meshes left out)\n");
}

}  // namespace

Expected<void> RunMeshBench(const MeshBenchOptions& options) {
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const SequenceInfo& info = source->info();
  MapConfig config;
  config.voxel_m = options.voxel_m;
  TSDFPP_RETURN_IF_ERROR(config.SetProfile(options.profile));
  TSDFPP_RETURN_IF_ERROR(config.Validate());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(options.threads));
  SetOpen3dThreads(options.threads);

  std::vector<Run> runs;
  for (const Method method : AllMethods()) {
    runs.emplace_back();
    runs.back().name = MethodName(method);
    runs.back().pipeline =
        std::make_unique<Pipeline>(PipelineConfig{.method = method, .map = config}, info.objects);
  }
  Open3dVolume peer(config.voxel_m, options.open3d_band * config.voxel_m);
  double peer_growth_mb = 0;
  const int count = std::min(info.frame_count, options.frames);
  for (int i = 0; i < count; ++i) {
    TSDFPP_ASSIGN(const Frame frame, source->Read(info.first_index + i));
    const auto growth_of = [](const auto& function) {
      const double before = ResidentMegabytes();
      function();
      return ResidentMegabytes() - before;
    };
    peer_growth_mb += growth_of([&] { peer.Integrate(frame); });
    for (Run& run : runs) {
      run.growth_mb += growth_of([&] { run.pipeline->Process(frame).value(); });
      run.frames.Measure(run.pipeline->map(), run.mesher,
                         (i + 1) % options.every == 0 || i + 1 == count);
      if (i + 1 < count) continue;
      const cv::Mat labels = LargestObjectAlone(frame);
      const auto copy = run.pipeline->map().Clone();
      SceneMesher mesher;
      mesher.TakeSceneChanges(*copy);
      for (int repeat = 0; repeat < kSmallChanges; ++repeat) {
        copy->Fuse(frame, labels);
        run.small.Measure(*copy, mesher, true);
      }
    }
  }
  std::printf(
      "%s, frames %d to %d, profile %s (bands of %g voxels in front, %g behind; Open3D's of %g), "
      "voxels of %g m, %d threads\n",
      info.name.c_str(), info.first_index, info.first_index + count - 1, options.profile.c_str(),
      config.trunc_front_voxels, config.trunc_back_voxels, options.open3d_band, options.voxel_m,
      options.threads);

  std::vector<double> peer_ms;
  std::vector<std::vector<double>> whole_ms(runs.size());
  std::vector<std::size_t> triangles(runs.size());
  Open3dVolume::Mesh scalable;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    scalable = peer.ExtractMesh();
    peer_ms.push_back(scalable.seconds);
    for (std::size_t m = 0; m < runs.size(); ++m) {
      SceneMesher from_scratch;
      whole_ms[m].push_back(MillisecondsOf([&] {
        triangles[m] = from_scratch.SceneMesh(runs[m].pipeline->map()).triangles.size();
      }));
    }
  }
  scalable.seconds = Median(peer_ms);
  std::vector<double> final_ms;
  for (const auto& times : whole_ms) final_ms.push_back(Median(times));
  std::vector<ChildResult> grids;
  for (const int side : kBlockSides) grids.push_back(AskChild(options, side));
  PrintMeshing(runs, final_ms, triangles, scalable, grids);
  PrintMemory(runs, peer, peer_growth_mb, grids);
  return {};
}

Expected<void> RunVoxelBlockGrid(const MeshBenchOptions& options) {
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const SequenceInfo& info = source->info();
  SetOpen3dThreads(options.threads);
  VoxelBlockGridPeer peer(options.voxel_m, options.open3d_band * options.voxel_m,
                          options.block_side);
  double growth_mb = 0;
  const int count = std::min(info.frame_count, options.frames);
  for (int i = 0; i < count; ++i) {
    TSDFPP_ASSIGN(const Frame frame, source->Read(info.first_index + i));
    const double before = ResidentMegabytes();
    peer.Integrate(frame);
    growth_mb += ResidentMegabytes() - before;
  }
  std::vector<double> times_ms;
  VoxelBlockGridPeer::Mesh mesh;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    mesh = peer.ExtractMesh();
    times_ms.push_back(1e3 * mesh.seconds);
  }
  std::printf("%.3f %zu %zu %.1f\n", Median(times_ms), mesh.triangles, peer.OccupiedBytes(),
              growth_mb);
  return {};
}

}  // namespace tsdfpp
