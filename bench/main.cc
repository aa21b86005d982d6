// tsdfpp_bench side-by-side [options], or Google Benchmark's own options for the kernels.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <thread>

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
  if (argc < 2 || std::string_view(argv[1]) != "side-by-side") {
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    return 0;
  }
  tsdfpp::SideBySideOptions options;
  CLI::App app("Mapping beside Open3D's ScalableTSDFVolume, on the same frames in the same run");
  CLI::App* run = app.add_subcommand("side-by-side", "Run it");
  run->add_option("--scene", options.scene, "Scene or sequence")->capture_default_str();
  run->add_option("--profile", options.profile, "paper or close")->capture_default_str();
  run->add_option("--frames", options.frames, "Frames from the first on")
      ->check(CLI::Range(32, 100000))
      ->capture_default_str();
  run->add_option("--threads", options.threads, "Numbers of threads")
      ->delimiter(',')
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (const auto done = tsdfpp::RunSideBySide(options); !done) {
    std::fprintf(stderr, "tsdfpp_bench: %s\n", done.error().message.c_str());
    return static_cast<int>(done.error().kind);
  }
  return 0;
}
