// tsdfpp_bench side-by-side | render | figures [options], or Google Benchmark's own options for the
// kernels.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <thread>

#include "bench/figures.h"
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
  if (word != "side-by-side" && word != "render" && word != "figures") {
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
  tsdfpp::FigureOptions figures;
  CLI::App* figure = app.add_subcommand("figures", "What docs/map-figures.md shows, as CSV");
  figure->add_option("--out", figures.out, "Output folder")->capture_default_str();
  figure->add_option("--parts", figures.parts, "Some of them")
      ->delimiter(',')
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const auto done = figure->parsed()      ? tsdfpp::RunFigures(figures)
                    : rendering->parsed() ? tsdfpp::RunRenderBench(render)
                                          : tsdfpp::RunSideBySide(options);
  if (!done) {
    std::fprintf(stderr, "tsdfpp_bench: %s\n", done.error().message.c_str());
    return static_cast<int>(done.error().kind);
  }
  return 0;
}
