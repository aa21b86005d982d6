#include "bench/side_by_side.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <open3d/Open3DConfig.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>

#include "bench/clocks.h"
#include "bench/peer_process.h"
#include "bench/side_by_side_cases.h"
#include "bench/side_by_side_tables.h"
#include "core/files.h"
#include "eval/run/open_source.h"
#include "mapper/pipeline.h"

namespace tsdfpp {
namespace {

// Open3D's process, and what its volumes took in this run.
struct Peer {
  std::string how;
  std::unique_ptr<PeerProcess> process;
  std::vector<std::pair<std::string, SpeedRun>> runs;  // by the volume's name
};

// One thread waits for nobody: then it runs in one process alone.
Expected<std::vector<Peer>> StartPeers(const SideBySideCase& of, const SideBySideOptions& options,
                                       int threads) {
  const std::vector<std::string> arguments{"--scene",   options.scene,
                                           "--cases",   of.name,
                                           "--first",   fmt::format("{}", options.first),
                                           "--frames",  fmt::format("{}", options.frames),
                                           "--threads", fmt::format("{}", threads)};
  std::vector<Peer> peers;
  for (const OpenMpWait wait : {OpenMpWait::kPassive, OpenMpWait::kActive}) {
    if (threads == 1 && wait == OpenMpWait::kActive) continue;
    TSDFPP_ASSIGN(auto process, PeerProcess::Start(arguments, wait, threads));
    const char* how = threads == 1                   ? "one thread"
                      : wait == OpenMpWait::kPassive ? "threads that sleep while they wait"
                                                     : "threads that spin while they wait";
    peers.push_back({how, std::move(process), {}});
  }
  return peers;
}

Expected<void> IntegrateNext(std::vector<Peer>& peers) {
  for (Peer& peer : peers) {
    TSDFPP_ASSIGN(const auto all, peer.process->IntegrateNext());
    peer.runs.resize(all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      auto& [name, run] = peer.runs[i];
      name = all[i].name;
      run.ms.insert(run.ms.end(), all[i].ms.begin(), all[i].ms.end());
      run.bytes = all[i].bytes;
    }
  }
  return {};
}

// A method's two maps.
struct Timed {
  std::unique_ptr<Pipeline> equal;
  std::unique_ptr<Pipeline> shipped;
  SpeedRun equal_run;
  SpeedRun shipped_run;

  void Process(const std::vector<Frame>& frames, int to_skip) {
    for (int k = 0; k < static_cast<int>(frames.size()); ++k) {
      const double start = WallMilliseconds();
      equal->Process(frames[static_cast<std::size_t>(k)]).value();
      if (k >= to_skip) equal_run.ms.push_back(WallMilliseconds() - start);
    }
    for (int k = 0; k < static_cast<int>(frames.size()); ++k) {
      const StepTimes steps = shipped->Process(frames[static_cast<std::size_t>(k)]).value();
      if (k >= to_skip) shipped_run.ms.push_back(1e3 * steps.fuse_s);
    }
    equal_run.bytes = equal->map().Memory().bytes;
    shipped_run.bytes = shipped->map().Memory().bytes;
  }
};

Timed MakeTimed(Method method, const SideBySideCase& of, const std::vector<ObjectInfo>& objects) {
  PipelineConfig config{.method = method};
  config.map.voxel_m = of.voxel_m;
  config.map.trunc_front_voxels = of.truncation_voxels;
  config.map.trunc_back_voxels = of.truncation_voxels;
  Timed timed;
  timed.shipped = std::make_unique<Pipeline>(config, objects);
  config.map.colour_whole_band = true;
  timed.equal = std::make_unique<Pipeline>(config, objects);
  return timed;
}

void AddRun(std::vector<Speed>& speeds, const std::string& name, const std::string& how,
            SpeedRun run) {
  auto found = std::find_if(speeds.begin(), speeds.end(), [&](const Speed& speed) {
    return speed.name == name && speed.how == how;
  });
  if (found == speeds.end()) found = speeds.insert(found, {name, how, {}});
  found->runs.push_back(std::move(run));
}

// The same frames through Open3D's processes and every method, in turn, once.
Expected<void> MeasureOnce(FrameSource& source, const SideBySideCase& of,
                           const SideBySideOptions& options, const std::vector<Method>& methods,
                           int threads, ThreadSpeeds& speeds) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  TSDFPP_ASSIGN(std::vector<Peer> peers, StartPeers(of, options, threads));
  std::vector<Timed> maps;
  for (const Method method : methods) {
    maps.push_back(MakeTimed(method, of, source.info().objects));
  }
  const int end = std::min(source.info().frame_count, options.first + options.frames);
  for (int next = options.first; next < end; next += kFramesInARow) {
    TSDFPP_RETURN_IF_ERROR(IntegrateNext(peers));
    TSDFPP_ASSIGN(const auto frames, ReadFramesInARow(source, of, next, end));
    for (Timed& map : maps) map.Process(frames, options.first + options.warm_up - next);
  }
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const std::string name(MethodName(methods[m]));
    AddRun(speeds.equal, name, "", std::move(maps[m].equal_run));
    AddRun(speeds.shipped, name, "", std::move(maps[m].shipped_run));
  }
  for (Peer& peer : peers) {
    for (auto& [name, run] : peer.runs) AddRun(speeds.peers, name, peer.how, std::move(run));
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

// Where, on what and how the figures were made.
std::string MeasuredHow(const SideBySideOptions& options, const SequenceInfo& info,
                        double minutes) {
  const int first = info.first_index + options.first;
  const int end = std::min(info.frame_count, options.first + options.frames);
  return fmt::format(
      "`tsdfpp_bench side-by-side --scene {} --cases {} --first {} --frames {} --threads {} "
      "--methods {} --runs {}` on {}, in {:.0f} minutes: {}x{}, frames {} to {} mapped, from {} on "
      "counted, in each of {} runs. Open3D {}.\n",
      options.scene, fmt::join(options.cases, ","), options.first, options.frames,
      fmt::join(options.threads, ","), fmt::join(options.methods, ","), options.runs, Machine(),
      minutes, info.intrinsics.width, info.intrinsics.height, first, info.first_index + end - 1,
      first + options.warm_up, options.runs, OPEN3D_VERSION);
}

Expected<void> WriteTables(const std::filesystem::path& out, const std::vector<CaseSpeeds>& cases,
                           const std::string& measured) {
  for (const CaseSpeeds& speeds : cases) {
    TSDFPP_RETURN_IF_ERROR(WriteFile(out / (speeds.of.name + ".md"), CaseTable(speeds)));
  }
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "summary.md", SummaryTable(cases)));
  return WriteFile(out / "measured.md", measured);
}

}  // namespace

Expected<void> RunSideBySide(const SideBySideOptions& options) {
  const double start = WallMilliseconds();
  std::vector<CaseSpeeds> cases;
  TSDFPP_ASSIGN(const std::vector<SideBySideCase> named, CasesNamed(options.cases));
  for (const SideBySideCase& of : named) cases.push_back({of, {}});
  std::vector<Method> methods;
  for (const std::string& name : options.methods) {
    TSDFPP_ASSIGN(const Method method, MethodFromName(name));
    methods.push_back(method);
  }
  TSDFPP_ASSIGN(auto source, OpenSource(options.scene));
  const int left = source->info().frame_count - options.first;
  if (cases.empty() || methods.empty() || options.threads.empty()) {
    return UsageError("needs a case, a method and a number of threads");
  }
  if (std::min(left, options.frames) <= options.warm_up) {
    return UsageError("needs more frames than the {} that warm up; from frame {} on there are {}",
                      options.warm_up, options.first, std::max(left, 0));
  }
  if (source->info().objects.size() < 2) return UsageError("needs a scene with an object");
  if (!options.out.empty()) TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(options.out));
  for (int run = 0; run < options.runs; ++run) {
    for (CaseSpeeds& speeds : cases) {
      for (const int threads : options.threads) {
        TSDFPP_RETURN_IF_ERROR(
            MeasureOnce(*source, speeds.of, options, methods, threads, speeds.by_threads[threads]));
      }
    }
    std::fprintf(stderr, "run %d of %d\n", run + 1, options.runs);
  }
  for (const CaseSpeeds& speeds : cases) {
    fmt::print("{}\n\n{}\n", speeds.of.title, CaseTable(speeds));
  }
  const std::string measured =
      MeasuredHow(options, source->info(), (WallMilliseconds() - start) / 60e3);
  fmt::print("{}\n{}", SummaryTable(cases), measured);
  return options.out.empty() ? Expected<void>{} : WriteTables(options.out, cases, measured);
}

}  // namespace tsdfpp
