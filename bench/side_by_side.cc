#include "bench/side_by_side.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>

#include "core/files.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/adapters/voxel_block_grid.h"
#include "eval/open_source.h"
#include "mapper/pipeline.h"

namespace tsdfpp {
namespace {

constexpr const char* kHowToRead =
    R"(Milliseconds a frame by numbers of threads (T), with all objects, colour and allocation of blocks; of the runs the one with the least worst frame.
The first four columns are of pose updates and fusion together; *fusion* is the median of fusion alone, as the volumes of Open3D, which move nothing, are timed. `tsdf++/anchored` and `volumes` move nothing either when a pose changes: what the move does to the index is part of the fusion that follows.
Each map takes ten frames in a row, then the next has its turn.
Open3D integrates the same frames with colour, one volume for all, in the same way, in a process of its own, its OpenMP threads sleeping while they wait or spinning; of all its runs the one with the least median.
x faster: the median of the faster of Open3D's two over the row's; first over the one of all, then over that of fusion. MB: occupied blocks, with our lists and tables.
)";
// Frames are made, then mapped in a row: a map that takes turns with others, or with the renderer,
// at each frame pays for what they leave in the caches, which a mapper on a robot does not.
constexpr int kFramesInARow = 10;
constexpr int kBlockSide_voxels = 16;  // of VoxelBlockGrid: Open3D's own default

struct Case {
  std::string name;
  std::string title;
  double voxel_m = 0;
  double truncation_voxels = 0;
  bool one_object = false;  // the first object's pixels alone
};

const std::vector<Case>& AllCases() {
  static const std::vector<Case> cases{
      {"1cm", "1 cm, truncation 10 voxels", 0.01, 10, false},
      {"5mm", "5 mm, truncation 6 voxels", 0.005, 6, false},
      {"2mm", "2 mm, truncation 6 voxels, one object alone", 0.002, 6, true}};
  return cases;
}

Expected<std::vector<Case>> CasesOf(const SideBySideOptions& options) {
  std::vector<Case> cases;
  for (const std::string& name : options.cases) {
    const auto found = std::find_if(AllCases().begin(), AllCases().end(),
                                    [&](const Case& c) { return c.name == name; });
    if (found == AllCases().end()) {
      return UsageError("case '{}' is unknown, expected one of {}", name,
                        fmt::join(CaseNames(), ", "));
    }
    cases.push_back(*found);
  }
  return cases;
}

Expected<Frame> ReadFrame(FrameSource& source, const Case& of, int i) {
  TSDFPP_ASSIGN(Frame frame, source.Read(source.info().first_index + i));
  if (of.one_object) {
    const InstanceId object = source.info().objects.at(1).id;
    frame.depth.setTo(0, frame.mask != object);
  }
  return frame;
}

// From frame `first` on, as many as are mapped in a row, before `last`.
Expected<std::vector<Frame>> ReadFrames(FrameSource& source, const Case& of, int first, int last) {
  std::vector<Frame> frames;
  for (int i = first; i < std::min(first + kFramesInARow, last); ++i) {
    TSDFPP_ASSIGN(Frame frame, ReadFrame(source, of, i));
    frames.push_back(std::move(frame));
  }
  return frames;
}

// Milliseconds of frames.
struct Times {
  std::vector<double> ms;
  std::vector<double> fusion_ms;  // poses left out
  std::size_t bytes = 0;

  double At(double quantile) const { return QuantileOf(ms, quantile); }
  double Median() const { return At(0.5); }
  double Worst() const { return At(1); }
  double MedianOfFusion() const { return QuantileOf(fusion_ms, 0.5); }

 private:
  static double QuantileOf(std::vector<double> values, double quantile) {
    std::sort(values.begin(), values.end());
    const auto last = static_cast<double>(values.size() - 1);
    return values[static_cast<std::size_t>(quantile * last + 0.5)];
  }
};

// By name and number of threads.
using Table = std::map<std::string, std::map<int, Times>>;

using Clock = std::chrono::steady_clock;
double Milliseconds(Clock::time_point from) {
  return std::chrono::duration<double, std::milli>(Clock::now() - from).count();
}

MapConfig ConfigOf(const Case& of) {
  MapConfig config;
  config.voxel_m = of.voxel_m;
  config.trunc_front_voxels = of.truncation_voxels;
  config.trunc_back_voxels = of.truncation_voxels;
  return config;
}

// Every method in turn.
Expected<void> MeasureMethods(FrameSource& source, const Case& of, const SideBySideOptions& options,
                              const std::vector<Method>& methods, int threads, Table& measured) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  const int last = std::min(source.info().frame_count, options.frames);
  for (int run = 0; run < options.runs; ++run) {
    std::vector<std::unique_ptr<Pipeline>> pipelines;
    std::vector<Times> times(methods.size());
    for (const Method method : methods) {
      pipelines.push_back(std::make_unique<Pipeline>(
          PipelineConfig{method, ConfigOf(of), PoseSource::kGiven, {}}, source.info().objects));
    }
    for (int first = 0; first < last; first += kFramesInARow) {
      TSDFPP_ASSIGN(const auto frames, ReadFrames(source, of, first, last));
      for (std::size_t m = 0; m < pipelines.size(); ++m) {
        for (int k = 0; k < static_cast<int>(frames.size()); ++k) {
          const auto start = Clock::now();
          const StepTimes steps = pipelines[m]->Process(frames[static_cast<std::size_t>(k)]);
          if (first + k < options.warm_up) continue;
          times[m].ms.push_back(Milliseconds(start));
          times[m].fusion_ms.push_back(1e3 * steps.fuse_s);
        }
      }
    }
    for (std::size_t m = 0; m < pipelines.size(); ++m) {
      const std::string name(MethodName(methods[m]));
      times[m].bytes = pipelines[m]->map().Memory().bytes;
      Times& best = measured[name][threads];
      if (best.ms.empty() || times[m].Worst() < best.Worst()) best = times[m];
    }
  }
  return {};
}

// Open3D's times, from a process whose threads wait by `policy`.
Expected<void> MeasurePeers(const Case& of, const SideBySideOptions& options, const char* policy,
                            Table& table) {
  const std::string command = fmt::format(
      "OMP_WAIT_POLICY={} OMP_NUM_THREADS={} /proc/{}/exe peers --scene '{}' --cases {} --frames "
      "{} "
      "--threads {}",
      policy, *std::max_element(options.threads.begin(), options.threads.end()), getpid(),
      options.scene, of.name, options.frames, fmt::join(options.threads, ","));
  std::FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return EnvironmentError("cannot start Open3D's process");
  std::string output;
  std::array<char, 4096> buffer;
  while (const std::size_t got = std::fread(buffer.data(), 1, buffer.size(), pipe)) {
    output.append(buffer.data(), got);
  }
  if (pclose(pipe) != 0) return EnvironmentError("Open3D's process failed: {}", command);
  std::istringstream lines(output);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t tab = line.find('\t');
    if (tab == std::string::npos) continue;  // Open3D's own messages
    std::istringstream numbers(line.substr(tab));
    int threads = 0;
    Times times;
    numbers >> threads >> times.bytes;
    for (double ms = 0; numbers >> ms;) times.ms.push_back(ms);
    times.fusion_ms = times.ms;
    if (times.ms.empty()) return EnvironmentError("Open3D's process printed: {}", line);
    Times& best = table[line.substr(0, tab)][threads];
    if (best.ms.empty() || times.Median() < best.Median()) best = times;
  }
  return {};
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
                          times.At(0.99), times.Worst(), faster_peer.at(count) / times.Median(),
                          times.MedianOfFusion(), faster_peer.at(count) / times.MedianOfFusion());
    }
    if (threads.size() > 1) {
      rows += fmt::format(" {:.2f} |", by_threads.at(threads.front()).Median() /
                                           by_threads.at(threads.back()).Median());
    }
    rows +=
        fmt::format(" {:.0f} |\n", 1e-6 * static_cast<double>(by_threads.at(threads.back()).bytes));
  }
  return rows;
}

std::string TablesOf(const Case& of, const SideBySideOptions& options, const Table& peers,
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

std::vector<std::string> CaseNames() {
  std::vector<std::string> names;
  for (const Case& of : AllCases()) names.push_back(of.name);
  return names;
}

Expected<void> RunPeers(const SideBySideOptions& options) {
  TSDFPP_ASSIGN(const std::vector<Case> cases, CasesOf(options));
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const int last = std::min(source->info().frame_count, options.frames);
  for (const Case& of : cases) {
    const double truncation_m = of.truncation_voxels * of.voxel_m;
    for (const int threads : options.threads) {
      SetOpen3dThreads(threads);
      Open3dVolume scalable(of.voxel_m, truncation_m);
      VoxelBlockGridPeer grid(of.voxel_m, truncation_m, kBlockSide_voxels);
      Times scalable_times;
      Times grid_times;
      for (int first = 0; first < last; first += kFramesInARow) {
        TSDFPP_ASSIGN(const auto frames, ReadFrames(*source, of, first, last));
        const auto integrate = [&](auto& volume, Times& times) {
          int i = first;
          for (const Frame& frame : frames) {
            const double seconds = volume.Integrate(frame);
            if (i++ >= options.warm_up) times.ms.push_back(1e3 * seconds);
          }
        };
        integrate(scalable, scalable_times);
        integrate(grid, grid_times);
      }
      const auto print = [&](const char* name, std::size_t bytes, const Times& times) {
        fmt::print("{}\t{} {} {}\n", name, threads, bytes, fmt::join(times.ms, " "));
      };
      print("Open3D ScalableTSDFVolume", scalable.OccupiedBytes(), scalable_times);
      print("Open3D VoxelBlockGrid", grid.OccupiedBytes(), grid_times);
    }
  }
  return {};
}

Expected<void> RunSideBySide(const SideBySideOptions& options) {
  TSDFPP_ASSIGN(const std::vector<Case> cases, CasesOf(options));
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
  for (const Case& of : cases) {
    Table peers;
    for (int run = 0; run < options.runs; ++run) {
      TSDFPP_RETURN_IF_ERROR(MeasurePeers(of, options, "passive", peers));
      TSDFPP_RETURN_IF_ERROR(MeasurePeers(of, options, "active", peers));
    }
    Table measured;
    for (const int threads : options.threads) {
      TSDFPP_RETURN_IF_ERROR(MeasureMethods(*source, of, options, methods, threads, measured));
    }
    const std::string tables = TablesOf(of, options, peers, measured);
    fmt::print("{}\n", tables);
    std::fflush(stdout);
    page += '\n';
    page += tables;
  }
  if (!options.page.empty()) TSDFPP_RETURN_IF_ERROR(WriteFile(options.page, page));
  return {};
}

}  // namespace tsdfpp
