#include "bench/side_by_side.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <limits>
#include <map>
#include <memory>

#include "bench/peer_process.h"
#include "bench/side_by_side_cases.h"
#include "core/files.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/adapters/voxel_block_grid.h"
#include "eval/open_source.h"
#include "mapper/pipeline.h"

namespace tsdfpp {
namespace {

constexpr const char* kHowToRead =
    R"(Milliseconds a frame by numbers of threads (T), with all objects, colour and allocation of blocks: medians over the frames of all runs; p99 and worst of the run with the least worst frame.
The first four columns are of pose updates and fusion together; *fusion* is the median of fusion alone, as the volumes of Open3D, which move nothing, are timed. `tsdf++/anchored` and `volumes` move nothing either when a pose changes: what the move does to the index is part of the fusion that follows.
Each map takes ten frames in a row, then the next has its turn, Open3D's among them, so that what slows the machine for a while slows all.
Open3D integrates the same frames with colour, one volume for all, in two processes of its own, one with OpenMP threads that sleep while they wait and one with threads that spin, both stopped while it is not their turn; the one with the lesser median counts.
x faster: the median of the faster of Open3D's two over the row's; first over the one of all, then over that of fusion. MB: occupied blocks, with our lists and tables.
)";
constexpr int kBlockSide_voxels = 16;  // of VoxelBlockGrid: Open3D's own default

double QuantileOf(std::vector<double> values, double quantile) {
  std::sort(values.begin(), values.end());
  const auto last = static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(quantile * last + 0.5)];
}

// Milliseconds of frames.
struct Run {
  std::vector<double> ms;
  std::vector<double> fusion_ms;  // poses left out
  std::size_t bytes = 0;

  double Worst() const { return QuantileOf(ms, 1); }
};
class Times {
 public:
  void Add(Run run) {
    all_.ms.insert(all_.ms.end(), run.ms.begin(), run.ms.end());
    all_.fusion_ms.insert(all_.fusion_ms.end(), run.fusion_ms.begin(), run.fusion_ms.end());
    if (steadiest_.ms.empty() || run.Worst() < steadiest_.Worst()) steadiest_ = std::move(run);
  }
  double Median() const { return QuantileOf(all_.ms, 0.5); }
  double MedianOfFusion() const { return QuantileOf(all_.fusion_ms, 0.5); }
  // Of the run with the least worst frame.
  double P99() const { return QuantileOf(steadiest_.ms, 0.99); }
  double Worst() const { return steadiest_.Worst(); }
  std::size_t Bytes() const { return steadiest_.bytes; }

 private:
  Run all_;
  Run steadiest_;
};

// By name and number of threads.
using Table = std::map<std::string, std::map<int, Times>>;
// Open3D's, by how its threads wait.
using PeerTables = std::map<OpenMpWait, Table>;

constexpr std::array<OpenMpWait, 2> kWaits{OpenMpWait::kPassive, OpenMpWait::kActive};

using Clock = std::chrono::steady_clock;
double Milliseconds(Clock::time_point from) {
  return std::chrono::duration<double, std::milli>(Clock::now() - from).count();
}

MapConfig ConfigOf(const SideBySideCase& of) {
  MapConfig config;
  config.voxel_m = of.voxel_m;
  config.trunc_front_voxels = of.truncation_voxels;
  config.trunc_back_voxels = of.truncation_voxels;
  return config;
}

// Open3D's process, and what it took so far.
struct Peer {
  OpenMpWait wait;
  std::unique_ptr<PeerProcess> process;
  std::map<std::string, Run> runs;
};

Expected<std::vector<Peer>> StartPeers(const SideBySideCase& of, const SideBySideOptions& options,
                                       int threads) {
  std::vector<Peer> peers;
  for (const OpenMpWait wait : kWaits) {
    TSDFPP_ASSIGN(auto process, PeerProcess::Start({"--scene", options.scene, "--cases", of.name,
                                                    "--frames", fmt::format("{}", options.frames),
                                                    "--threads", fmt::format("{}", threads)},
                                                   wait, threads));
    peers.push_back({wait, std::move(process), {}});
  }
  return peers;
}

Expected<void> IntegrateNext(std::vector<Peer>& peers) {
  for (Peer& peer : peers) {
    TSDFPP_ASSIGN(const auto all, peer.process->IntegrateNext());
    for (const PeerTimes& said : all) {
      Run& run = peer.runs[said.name];
      run.ms.insert(run.ms.end(), said.ms.begin(), said.ms.end());
      run.fusion_ms = run.ms;
      run.bytes = said.bytes;
    }
  }
  return {};
}

// The same frames through Open3D's processes and every method, in turn.
Expected<void> Measure(FrameSource& source, const SideBySideCase& of,
                       const SideBySideOptions& options, const std::vector<Method>& methods,
                       int threads, PeerTables& of_peers, Table& of_methods) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  const int last = std::min(source.info().frame_count, options.frames);
  TSDFPP_ASSIGN(std::vector<Peer> peers, StartPeers(of, options, threads));
  std::vector<std::unique_ptr<Pipeline>> pipelines;
  std::vector<Run> runs(methods.size());
  for (const Method method : methods) {
    pipelines.push_back(std::make_unique<Pipeline>(
        PipelineConfig{method, ConfigOf(of), PoseSource::kGiven, {}}, source.info().objects));
  }
  for (int first = 0; first < last; first += kFramesInARow) {
    TSDFPP_RETURN_IF_ERROR(IntegrateNext(peers));
    TSDFPP_ASSIGN(const auto frames, ReadFramesInARow(source, of, first, last));
    for (std::size_t m = 0; m < pipelines.size(); ++m) {
      for (int k = 0; k < static_cast<int>(frames.size()); ++k) {
        const auto start = Clock::now();
        const StepTimes steps = pipelines[m]->Process(frames[static_cast<std::size_t>(k)]);
        if (first + k < options.warm_up) continue;
        runs[m].ms.push_back(Milliseconds(start));
        runs[m].fusion_ms.push_back(1e3 * steps.fuse_s);
      }
    }
  }
  for (std::size_t m = 0; m < pipelines.size(); ++m) {
    runs[m].bytes = pipelines[m]->map().Memory().bytes;
    of_methods[std::string(MethodName(methods[m]))][threads].Add(std::move(runs[m]));
  }
  for (const Peer& peer : peers) {
    for (const auto& [name, run] : peer.runs) of_peers[peer.wait][name][threads].Add(run);
  }
  return {};
}

// Of each number of threads those with the lesser median.
Table FasterOf(const PeerTables& tables) {
  Table faster;
  for (const auto& [wait, table] : tables) {
    for (const auto& [name, by_threads] : table) {
      for (const auto& [threads, times] : by_threads) {
        const auto [at, is_first] = faster[name].try_emplace(threads, times);
        if (!is_first && times.Median() < at->second.Median()) at->second = times;
      }
    }
  }
  return faster;
}

std::string Machine() {
  std::ifstream file("/proc/cpuinfo");
  std::string model = "unknown processor";
  int cores = 0;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("model name")) continue;
    model = line.substr(line.find(':') + 2);
    ++cores;
  }
  return fmt::format("{} cores of {}", cores, model);
}

std::string RowsOf(const Table& table, const std::vector<int>& threads,
                   const std::map<int, double>& faster_peer) {
  std::string rows;
  for (const auto& [name, by_threads] : table) {
    rows += fmt::format("| {} |", name);
    for (const int count : threads) {
      const Times& times = by_threads.at(count);
      rows += fmt::format(" {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} |", times.Median(),
                          times.P99(), times.Worst(), faster_peer.at(count) / times.Median(),
                          times.MedianOfFusion(), faster_peer.at(count) / times.MedianOfFusion());
    }
    if (threads.size() > 1) {
      rows += fmt::format(" {:.2f} |", by_threads.at(threads.front()).Median() /
                                           by_threads.at(threads.back()).Median());
    }
    rows += fmt::format(" {:.0f} |\n",
                        1e-6 * static_cast<double>(by_threads.at(threads.back()).Bytes()));
  }
  return rows;
}

std::string TablesOf(const SideBySideCase& of, const SideBySideOptions& options, const Table& peers,
                     const Table& measured) {
  std::map<int, double> faster_peer;
  for (const int count : options.threads) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [name, by_threads] : peers) {
      least = std::min(least, by_threads.at(count).Median());
    }
    faster_peer[count] = least;
  }
  std::string text = fmt::format("## {}\n\n|  |", of.title);
  for (const int count : options.threads) {
    text += fmt::format(" {} T: median | p99 | worst | x faster | fusion | x faster |", count);
  }
  const bool several = options.threads.size() > 1;
  if (several) {
    text += fmt::format(" {} T / {} T |", options.threads.front(), options.threads.back());
  }
  text += " MB |\n|---|";
  for (std::size_t i = 0; i < 6 * options.threads.size() + (several ? 2 : 1); ++i) text += "---|";
  text += '\n';
  text += RowsOf(peers, options.threads, faster_peer);
  text += RowsOf(measured, options.threads, faster_peer);
  return text;
}

}  // namespace

Expected<void> RunPeers(const SideBySideOptions& options) {
  TSDFPP_ASSIGN(const std::vector<SideBySideCase> cases, CasesNamed(options.cases));
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const int last = std::min(source->info().frame_count, options.frames);
  for (const SideBySideCase& of : cases) {
    const double truncation_m = of.truncation_voxels * of.voxel_m;
    for (const int threads : options.threads) {
      SetOpen3dThreads(threads);
      Open3dVolume scalable(of.voxel_m, truncation_m);
      VoxelBlockGridPeer grid(of.voxel_m, truncation_m, kBlockSide_voxels);
      for (int first = 0; first < last && AwaitPeerTurn(); first += kFramesInARow) {
        TSDFPP_ASSIGN(const auto frames, ReadFramesInARow(*source, of, first, last));
        const auto integrate = [&](const char* name, auto& volume) {
          PeerTimes times{name, 0, {}};
          for (int k = 0; k < static_cast<int>(frames.size()); ++k) {
            const double seconds = volume.Integrate(frames[static_cast<std::size_t>(k)]);
            if (first + k >= options.warm_up) times.ms.push_back(1e3 * seconds);
          }
          times.bytes = volume.OccupiedBytes();
          SayPeerTimes(times);
        };
        integrate("Open3D ScalableTSDFVolume", scalable);
        integrate("Open3D VoxelBlockGrid", grid);
        EndPeerTurn();
      }
    }
  }
  return {};
}

Expected<void> RunSideBySide(const SideBySideOptions& options) {
  TSDFPP_ASSIGN(const std::vector<SideBySideCase> cases, CasesNamed(options.cases));
  std::vector<Method> methods;
  for (const std::string& name : options.methods) {
    TSDFPP_ASSIGN(const Method method, MethodFromName(name));
    methods.push_back(method);
  }
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const Intrinsics& k = source->info().intrinsics;
  if (options.threads.empty() || options.frames <= options.warm_up ||
      source->info().frame_count <= options.warm_up) {
    return UsageError("needs a number of threads, and more frames than the {} that warm up",
                      options.warm_up);
  }
  if (source->info().objects.size() < 2) return UsageError("needs a scene with an object");
  const int first = source->info().first_index;
  const int last = std::min(source->info().frame_count, options.frames);
  std::string page = fmt::format(
      "# What mapping costs\n\nPrinted by `build/release/tsdfpp_bench side-by-side --scene {} "
      "--cases {} --frames {} --threads {} --methods {} --runs {} --page docs/performance.md` on "
      "{}: {}x{}, frames {} to {} counted.\n\n",
      options.scene, fmt::join(options.cases, ","), options.frames, fmt::join(options.threads, ","),
      fmt::join(options.methods, ","), options.runs, Machine(), k.width, k.height,
      first + options.warm_up, first + last - 1);
  page += kHowToRead;
  for (const SideBySideCase& of : cases) {
    PeerTables peers;
    Table measured;
    for (const int threads : options.threads) {
      for (int run = 0; run < options.runs; ++run) {
        TSDFPP_RETURN_IF_ERROR(Measure(*source, of, options, methods, threads, peers, measured));
      }
    }
    const std::string tables = TablesOf(of, options, FasterOf(peers), measured);
    fmt::print("{}\n", tables);
    std::fflush(stdout);
    page += '\n';
    page += tables;
  }
  if (!options.page.empty()) TSDFPP_RETURN_IF_ERROR(WriteFile(options.page, page));
  return {};
}

}  // namespace tsdfpp
