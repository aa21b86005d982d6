// tsdfpp_bench side-by-side | rays | render [options], or Google Benchmark's own options for the
// kernels.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <thread>

#include "bench/rays.h"
#include "bench/render.h"
#include "bench/side_by_side.h"

int main(int argc, char** argv) {
  // OpenMP's waiting threads would take the cores from whoever comes after Open3D; the library
  // reads this as it is loaded, so the program starts itself again.
  if (std::getenv("OMP_WAIT_POLICY") == nullptr) {
    setenv("OMP_WAIT_POLICY", "passive", 1);
    // Without it Open3D 0.16 does not heed omp_set_num_threads.
    setenv("OMP_NUM_THREADS", std::to_string(std::thread::hardware_concurrency()).c_str(), 0);
    execv("/proc/self/exe", argv);
  }
  const std::string_view word = argc < 2 ? "" : argv[1];
  if (word != "side-by-side" && word != "render" && word != "rays") {
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    return 0;
  }
  tsdfpp::SideBySideOptions options;
  CLI::App app("Measurements of the whole, each printed as a table");
  app.require_subcommand(1);
  CLI::App* run = app.add_subcommand(
      "side-by-side", "Mapping beside Open3D's ScalableTSDFVolume, on the same frames");
  run->add_option("--scene", options.scene, "Scene or sequence")->capture_default_str();
  run->add_option("--profile", options.profile, "paper or close")->capture_default_str();
  run->add_option("--frames", options.frames, "Frames from the first on")
      ->check(CLI::Range(32, 100000))
      ->capture_default_str();
  run->add_option("--threads", options.threads, "Numbers of threads")
      ->delimiter(',')
      ->capture_default_str();
  tsdfpp::RenderBenchOptions render;
  CLI::App* rendering = app.add_subcommand("render", "Rendering and writing, step by step");
  rendering->add_option("--scene", render.scene, "Scene")->capture_default_str();
  rendering->add_option("--frames", render.frames, "Frames, spread over the scene")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  rendering->add_option("--repeats", render.repeats, "Of each frame; the fastest counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  rendering->add_option("--jobs", render.jobs, "Processes side by side that the rate is of")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  tsdfpp::RaysBenchOptions rays;
  CLI::App* casting = app.add_subcommand(
      "rays", "Ray casting beside Open3D's VoxelBlockGrid, and what more ids cost");
  casting->add_option("--scene", rays.scene, "Scene or sequence")->capture_default_str();
  casting->add_option("--profile", rays.profile, "paper or close")->capture_default_str();
  casting->add_option("--frames", rays.frames, "Frames from the first on")
      ->check(CLI::Range(8, 1000))
      ->capture_default_str();
  casting->add_option("--every", rays.every, "Frames between casts")
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
  casting->add_option("--repeats", rays.repeats, "Of each cast; the fastest counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  casting->add_option("--threads", rays.threads, "Threads")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  casting->add_option("--limit", rays.limit_s, "Seconds that Open3D's process may take")
      ->check(CLI::Range(1.0, 1e5))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const auto done = rendering->parsed() ? tsdfpp::RunRenderBench(render)
                    : casting->parsed() ? tsdfpp::RunRaysBench(rays)
                                        : tsdfpp::RunSideBySide(options);
  if (!done) {
    std::fprintf(stderr, "tsdfpp_bench: %s\n", done.error().message.c_str());
    return static_cast<int>(done.error().kind);
  }
  return 0;
}
