#include "bench/render.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <vector>

#include "bench/clocks.h"
#include "bench/median.h"
#include "core/files.h"
#include "eval/run/workers.h"
#include "sequence/image_files.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

// The steps of one frame, milliseconds by name.
using Steps = std::map<std::string, double>;

Expected<Steps> MeasureFrame(SimulatedSource& source, int index, bool write,
                             const std::filesystem::path& scratch) {
  Steps steps;
  const double cpu = CpuMilliseconds();
  const double wall = WallMilliseconds();
  TSDFPP_ASSIGN(const Frame frame, source.Read(index));
  const RenderTimes& times = source.render_times();
  steps["draw depth + ids"] = times.geometry_ms;
  steps["draw colour + shadows"] = times.colour_ms;
  steps["read back"] = times.read_back_ms;
  steps["convert"] = times.convert_ms;
  steps["mend slivers"] = times.mend_ms;
  if (write) {
    std::map<std::string, std::string> files;
    double at = WallMilliseconds();
    const auto lap = [&](const char* name) {
      const double now = WallMilliseconds();
      steps[name] = now - at;
      at = now;
    };
    TSDFPP_ASSIGN(files["colour.png"], EncodeColour(frame.colour, "colour"));
    lap("encode colour (PNG)");
    TSDFPP_ASSIGN(files["depth.exr"], EncodeDepth(frame.depth, "depth"));
    lap("encode depth (EXR)");
    TSDFPP_ASSIGN(files["mask.png"], EncodeMask(frame.mask, "mask"));
    lap("encode mask (PNG)");
    for (const auto& [name, bytes] : files) {
      TSDFPP_RETURN_IF_ERROR(WriteFile(scratch / name, bytes));
    }
    lap("write");
  }
  steps["all, wall"] = WallMilliseconds() - wall;
  steps["all, CPU"] = CpuMilliseconds() - cpu;
  // generate writes each file once; to replace one makes some file systems wait for the disk.
  std::error_code ignored;
  std::filesystem::remove_all(scratch, ignored);
  return steps;
}

// One of the ways to render.
struct Mode {
  const char* title;
  SimOptions sim;
};

int FrameOf(const SceneConfig& scene, int i, int count) {
  return kFirstFrame + (scene.frames - 1) * i / std::max(1, count - 1);
}

// The steps of a frame of one process.
Expected<void> MeasureSteps(const SceneConfig& scene, const RenderBenchOptions& options,
                            const Mode& mode, const std::filesystem::path& scratch) {
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, mode.sim));
  std::map<std::string, std::vector<double>> all;
  for (int i = 0; i < options.frames; ++i) {
    Steps best;
    for (int repeat = 0; repeat < options.repeats; ++repeat) {
      TSDFPP_ASSIGN(Steps steps, MeasureFrame(*source, FrameOf(scene, i, options.frames),
                                              mode.sim.render_colour, scratch));
      if (best.empty() || steps.at("all, CPU") < best.at("all, CPU")) best = std::move(steps);
    }
    for (const auto& [name, ms] : best) all[name].push_back(ms);
  }
  fmt::print("{} ({}, {}x{}, {} frames of {})\n", mode.title, source->gl_info().renderer,
             scene.intrinsics.width, scene.intrinsics.height, options.frames, scene.name);
  for (const auto& [name, values] : all) fmt::print("  {:<24} {:7.2f} ms\n", name, Median(values));
  std::fflush(stdout);
  return {};
}

// Renders all frames in `jobs` processes, as generate does; returns frames a second.
Expected<double> MeasureRate(const SceneConfig& scene, const RenderBenchOptions& options,
                             const Mode& mode, const std::filesystem::path& scratch) {
  constexpr const char* kGo = "go";
  TSDFPP_ASSIGN(
      Workers workers, Workers::Start(options.jobs, [&](Channel& channel) -> Expected<void> {
        const auto own = scratch / fmt::format("{}", getpid());
        TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, mode.sim));
        // The first frame compiles shaders.
        TSDFPP_RETURN_IF_ERROR(MeasureFrame(*source, kFirstFrame, mode.sim.render_colour, own));
        channel.Send("ready");
        while (const auto line = channel.Receive()) {
          if (*line != kGo) return EnvironmentError("the bench sent '{}'", *line);
          for (int i = 0; i < options.frames; ++i) {
            TSDFPP_RETURN_IF_ERROR(MeasureFrame(*source, FrameOf(scene, i, options.frames),
                                                mode.sim.render_colour, own));
          }
          channel.Send("rendered");
        }
        return {};
      }));
  double start = 0;
  double best = 0;
  int waiting = options.jobs;
  int round = 0;  // 0: opening
  while (workers.running() > 0) {
    TSDFPP_ASSIGN(const auto message, workers.Next());
    if (!message) break;
    if (--waiting > 0) continue;
    const double seconds = (WallMilliseconds() - start) / 1e3;
    if (round > 0) best = std::max(best, options.jobs * options.frames / seconds);
    waiting = options.jobs;
    start = WallMilliseconds();
    for (int worker = 0; worker < options.jobs; ++worker) {
      if (round < options.repeats) {
        workers.Send(worker, kGo);
      } else {
        workers.Close(worker);
      }
    }
    ++round;
  }
  return best;
}

}  // namespace

Expected<void> RunRenderBench(const RenderBenchOptions& options) {
  setenv("LP_NUM_THREADS", "1", 0);  // as generate's workers
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(options.scene));
  const auto scratch =
      std::filesystem::temp_directory_path() / fmt::format("tsdfpp-render-{}", getpid());
  const std::vector<Mode> modes{
      {"antialiased colour + depth + masks, written", {true, {true}, {}}},
      {"colour without antialiasing + depth + masks, written", {true, {false}, {}}},
      {"depth + masks, streamed", {false, {}, {}}}};
  const auto run = [&]() -> Expected<void> {
    for (const Mode& mode : modes) {
      // In a child, since those of the rate are forked from this process.
      TSDFPP_ASSIGN(Workers workers, Workers::Start(1, [&](Channel&) {
                      return MeasureSteps(scene, options, mode, scratch / "steps");
                    }));
      while (workers.running() > 0) {
        TSDFPP_ASSIGN(const auto message, workers.Next());
        if (!message) break;
      }
      TSDFPP_ASSIGN(const double rate, MeasureRate(scene, options, mode, scratch));
      fmt::print("  {} processes: {:.1f} frames/s\n", options.jobs, rate);
    }
    return {};
  };
  const auto done = run();
  std::error_code ignored;
  std::filesystem::remove_all(scratch, ignored);
  return done;
}

}  // namespace tsdfpp
