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
#include "sequence/image_files.h"
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
  return steps;
}

Expected<void> Measure(const SceneConfig& scene, const RenderBenchOptions& options,
                       const SimOptions& sim, const char* title,
                       const std::filesystem::path& scratch) {
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, sim));
  std::map<std::string, std::vector<double>> all;
  for (int i = 0; i < options.frames; ++i) {
    const int index = kFirstFrame + (scene.frames - 1) * i / std::max(1, options.frames - 1);
    Steps best;
    for (int repeat = 0; repeat < options.repeats; ++repeat) {
      TSDFPP_ASSIGN(Steps steps, MeasureFrame(*source, index, sim.render_colour, scratch));
      if (best.empty() || steps.at("all, CPU") < best.at("all, CPU")) best = std::move(steps);
    }
    for (const auto& [name, ms] : best) all[name].push_back(ms);
  }
  fmt::print("{} ({}, {}x{}, {} frames of {})\n", title, source->gl_info().renderer,
             scene.intrinsics.width, scene.intrinsics.height, options.frames, scene.name);
  for (const auto& [name, values] : all) {
    if (!name.starts_with("all")) fmt::print("  {:<24} {:7.2f} ms\n", name, Median(values));
  }
  for (const char* name : {"all, CPU", "all, wall"}) {
    const double ms = Median(all.at(name));
    fmt::print("  {:<24} {:7.2f} ms, {:.1f} frames/s a core\n", name, ms, 1e3 / ms);
  }
  return {};
}

}  // namespace

Expected<void> RunRenderBench(const RenderBenchOptions& options) {
  setenv("LP_NUM_THREADS", "1", 0);  // as generate's workers
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(options.scene));
  const auto scratch =
      std::filesystem::temp_directory_path() / fmt::format("tsdfpp-render-{}", getpid());
  const auto run = [&]() -> Expected<void> {
    TSDFPP_RETURN_IF_ERROR(Measure(scene, options, {true, {true}, {}},
                                   "antialiased colour + depth + masks, written", scratch));
    TSDFPP_RETURN_IF_ERROR(Measure(scene, options, {true, {false}, {}},
                                   "colour without antialiasing + depth + masks, written",
                                   scratch));
    return Measure(scene, options, {false, {}, {}}, "depth + masks, streamed", scratch);
  };
  const auto done = run();
  std::error_code ignored;
  std::filesystem::remove_all(scratch, ignored);
  return done;
}

}  // namespace tsdfpp
