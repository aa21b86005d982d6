// tsdfpp_bench COMMAND [options], or Google Benchmark's own options for the kernels.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "bench/camera.h"
#include "bench/figures.h"
#include "bench/mesh.h"
#include "bench/motion.h"
#include "bench/rays.h"
#include "bench/released.h"
#include "bench/render.h"
#include "bench/returns.h"
#include "bench/scaling.h"
#include "bench/segment.h"
#include "bench/side_by_side.h"
#include "bench/terms.h"
#include "bench/track.h"
#include "bench/whole.h"
#include "core/guard.h"

namespace tsdfpp {
namespace {

// What the command line asked for.
using Chosen = std::function<Expected<void>()>;

void AddScene(CLI::App* command, std::string& scene) {
  command->add_option("--scene", scene, "Scene or sequence")->capture_default_str();
}
void AddProfile(CLI::App* command, std::string& profile) {
  command->add_option("--profile", profile, "paper or close")->capture_default_str();
}
void AddOpen3dBand(CLI::App* command, double& voxels) {
  command->add_option("--open3d-band", voxels, "Open3D's band on both sides, voxels")
      ->check(CLI::Range(1.0, 100.0))
      ->capture_default_str();
}
void AddCount(CLI::App* command, const char* name, int& count, const char* what, int least,
              int most) {
  command->add_option(name, count, what)->check(CLI::Range(least, most))->capture_default_str();
}

void AddSideBySide(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<SideBySideOptions>();
  CLI::App* run = app.add_subcommand(
      "side-by-side", "Mapping beside Open3D's two volumes with colour, on the same frames");
  CLI::App* peers = app.add_subcommand(
      "peers", "What side-by-side runs in a process of its own: Open3D's times frame by frame");
  for (CLI::App* command : {run, peers}) {
    AddScene(command, options->scene);
    command->add_option("--cases", options->cases, "Resolutions: 1cm, 5mm, 2mm")
        ->delimiter(',')
        ->capture_default_str();
    AddCount(command, "--first", options->first, "Frames of the sequence that are left out", 0,
             100000);
    AddCount(command, "--frames", options->frames, "Frames of a run; the first 8 warm up", 9,
             100000);
    command->add_option("--threads", options->threads, "Numbers of threads")
        ->delimiter(',')
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
  }
  run->add_option("--methods", options->methods, "Some of the methods")
      ->delimiter(',')
      ->capture_default_str();
  AddCount(run, "--runs", options->runs, "Of all; intervals are over them", 1, 100);
  run->add_option("--out", options->out, "Write the tables into this folder as well");
  run->callback([=, &chosen] { chosen = [=] { return RunSideBySide(*options); }; });
  peers->callback([=, &chosen] { chosen = [=] { return RunPeers(*options); }; });
}

void AddRender(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<RenderBenchOptions>();
  CLI::App* command = app.add_subcommand("render", "Rendering and writing, step by step");
  command->add_option("--scene", options->scene, "Scene")->capture_default_str();
  AddCount(command, "--frames", options->frames, "Frames, spread over the scene", 1, 100000);
  AddCount(command, "--repeats", options->repeats, "Of each frame; the fastest counts", 1, 1000);
  AddCount(command, "--jobs", options->jobs, "Processes side by side that the rate is of", 1, 256);
  command->callback([=, &chosen] { chosen = [=] { return RunRenderBench(*options); }; });
}

void AddRays(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<RaysBenchOptions>();
  CLI::App* command = app.add_subcommand(
      "rays", "Ray casting beside Open3D's VoxelBlockGrid, and what more ids cost");
  AddScene(command, options->scene);
  AddProfile(command, options->profile);
  AddOpen3dBand(command, options->open3d_band);
  AddCount(command, "--frames", options->frames, "Frames from the first on", 8, 1000);
  AddCount(command, "--every", options->every, "Frames between casts", 1, 8);
  AddCount(command, "--repeats", options->repeats, "Of each cast; the fastest counts", 1, 1000);
  AddCount(command, "--threads", options->threads, "Threads", 1, 1024);
  command->add_option("--limit", options->limit_s, "Seconds that Open3D's process may take")
      ->check(CLI::Range(1.0, 1e5))
      ->capture_default_str();
  command->callback([=, &chosen] { chosen = [=] { return RunRaysBench(*options); }; });
}

void AddMesh(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<MeshBenchOptions>();
  CLI::App* mesh = app.add_subcommand("mesh", "Meshing and memory beside Open3D's two volumes");
  CLI::App* grid = app.add_subcommand("voxel-block-grid", "What mesh runs in a process of its own");
  for (CLI::App* command : {mesh, grid}) {
    AddScene(command, options->scene);
    AddOpen3dBand(command, options->open3d_band);
    command->add_option("--voxel", options->voxel_m, "Voxel size, metres")->capture_default_str();
    AddCount(command, "--frames", options->frames, "Frames from the first on", 16, 100000);
    AddCount(command, "--threads", options->threads, "Number of threads", 1, 1024);
  }
  AddProfile(mesh, options->profile);
  AddCount(grid, "--block-side", options->block_side, "Voxels along a block's side", 1, 64);
  mesh->callback([=, &chosen] { chosen = [=] { return RunMeshBench(*options); }; });
  grid->callback([=, &chosen] { chosen = [=] { return RunVoxelBlockGrid(*options); }; });
}

void AddFigures(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<FigureOptions>();
  CLI::App* command = app.add_subcommand("figures", "What docs/map-figures.md shows, as CSV");
  command->add_option("--out", options->out, "Output folder")->capture_default_str();
  command->add_option("--parts", options->parts, "Some of them")
      ->delimiter(',')
      ->capture_default_str();
  command->callback([=, &chosen] { chosen = [=] { return RunFigures(*options); }; });
}

void AddSegment(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<SegmentBenchOptions>();
  CLI::App* command = app.add_subcommand("segment", "What docs/segmentation.md shows, as CSV");
  command->add_option("--out", options->out, "Output folder")->required();
  command->add_option("--parts", options->parts, "Some of them: scenes, networks, shelf")
      ->delimiter(',')
      ->check(CLI::IsMember({"scenes", "networks", "shelf"}))
      ->capture_default_str();
  command->add_option("--scenes", options->scenes, "Folder of scenes")->capture_default_str();
  command->add_option("--shelf", options->shelf, "Folder of apc_shelf_scene0000")
      ->capture_default_str();
  AddCount(command, "--frames", options->frames, "Of a scene, spread over it", 1, 100000);
  command->callback([=, &chosen] { chosen = [=] { return RunSegmentBench(*options); }; });
}

void AddTrack(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<TrackBenchOptions>();
  CLI::App* command =
      app.add_subcommand("track", "How well objects are tracked, scene by scene, as CSV");
  command->add_option("--out", options->out, "Output folder")->required();
  command->add_option("--scenes", options->scenes, "Folder of scenes")->capture_default_str();
  command->add_option("--only", options->only, "Names of some of them; default: all")
      ->delimiter(',');
  command->add_option("--depths", options->depths, "Some of: exact, noise")
      ->delimiter(',')
      ->check(CLI::IsMember({"exact", "noise"}))
      ->capture_default_str();
  command
      ->add_option("--runs", options->runs,
                   "known, or a tracker, a method and, if it is to be said, what becomes of pixels "
                   "that bleed: 'track tsdf++ keep'")
      ->delimiter(',')
      ->capture_default_str();
  AddCount(command, "--seeds", options->seeds, "Draws of the noise", 1, 1000);
  command->add_option("--track-config", options->settings, "Settings of track and known, TOML");
  command->add_option("--map-config", options->map, "Settings of the maps, TOML");
  AddCount(command, "--until", options->until, "The last frame", 1, 100000);
  command->callback([=, &chosen] { chosen = [=] { return RunTrackBench(*options); }; });
}

void AddTerms(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<TermsBenchOptions>();
  CLI::App* command = app.add_subcommand(
      "terms", "What each term of the tracker does for shapes that leave motions free, as CSV");
  command->add_option("--out", options->out, "Output folder")->required();
  command->add_option("--shapes", options->shapes, "Some of them; default: all")->delimiter(',');
  command->add_option("--sets", options->sets, "Some sets of terms, by name; default: all")
      ->delimiter(',');
  AddCount(command, "--seeds", options->seeds, "Draws of the noise", 1, 1000);
  command->add_option("--method", options->method, "The map")->capture_default_str();
  command->callback([=, &chosen] { chosen = [=] { return RunTermsBench(*options); }; });
}

void AddReturns(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<ReturnBenchOptions>();
  CLI::App* command = app.add_subcommand(
      "returns", "Whether objects that go out of sight come back under their ids, as CSV");
  command->add_option("--out", options->out, "Output folder")->required();
  AddCount(command, "--cases", options->cases, "In which objects come back", 1, 100000);
  AddCount(command, "--first-seed", options->first_seed, "Of the first case", 0, 1000000);
  command->add_option("--depth", options->depth, "exact or noise")
      ->check(CLI::IsMember({"exact", "noise"}))
      ->capture_default_str();
  command->add_option("--method", options->method, "The map")->capture_default_str();
  command->add_option("--track-config", options->settings, "Settings of the tracker, TOML");
  command->callback([=, &chosen] { chosen = [=] { return RunReturnBench(*options); }; });
}

void AddMotion(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<MotionBenchOptions>();
  CLI::App* command = app.add_subcommand(
      "motion",
      "Whether what moves, and nothing else, becomes an object without a network, as CSV");
  command->add_option("--out", options->out, "Output folder")->required();
  AddCount(command, "--cases", options->cases, "In which a toy moves; as many in which none does",
           1, 100000);
  AddCount(command, "--first-seed", options->first_seed, "Of the first case", 0, 1000000);
  command->add_option("--depth", options->depth, "exact or noise")
      ->check(CLI::IsMember({"exact", "noise"}))
      ->capture_default_str();
  command->add_option("--method", options->method, "The map")->capture_default_str();
  command->add_option("--track-config", options->settings, "Settings of the tracker, TOML");
  command->callback([=, &chosen] { chosen = [=] { return RunMotionBench(*options); }; });
}

void AddCamera(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<CameraBenchOptions>();
  CLI::App* command =
      app.add_subcommand("camera", "How well the camera is found by the background, as CSV");
  command->add_option("--out", options->out, "Output folder")->required();
  command->add_option("--scenes", options->scenes, "Scene files")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--recording", options->recording, "Folder of a TUM recording, or ''")
      ->capture_default_str();
  command->add_option("--camera", options->camera, "The recording's fx,fy,cx,cy, pixels")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--pose-offsets", options->pose_offsets_s,
                   "Seconds from the images' times to those of the recording's poses")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--method", options->method, "The map")->capture_default_str();
  command->add_option("--voxels", options->voxels_m, "Voxel sizes, metres")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--track-config", options->settings, "Settings of the tracker, TOML");
  AddCount(command, "--until", options->until, "The last frame", 1, 100000);
  command->callback([=, &chosen] { chosen = [=] { return RunCameraBench(*options); }; });
}

void AddWhole(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<WholeBenchOptions>();
  CLI::App* command = app.add_subcommand(
      "whole", "What a frame costs the whole system, from segmentation to fusion, beside Open3D");
  command->add_option("--scene", options->scene, "Scene file")->capture_default_str();
  command->add_option("--rates", options->rates, "Of live, frames a second, one for each scale")
      ->delimiter(',')
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option("--scales", options->scales, "Images so many times the scene's size")
      ->delimiter(',')
      ->check(CLI::Range(0.05, 4.0))
      ->capture_default_str();
  command->add_option("--settings", options->settings, "Some of them")
      ->delimiter(',')
      ->capture_default_str();
  AddCount(command, "--every", options->every, "The network's frames, of beside", 1, 1000);
  AddCount(command, "--first", options->first, "Frames of the sequence that are left out", 0,
           100000);
  AddCount(command, "--frames", options->frames, "Of a run; the first 20 warm up", 21, 100000);
  AddCount(command, "--runs", options->runs, "Of all; figures are medians over them", 1, 100);
  AddCount(command, "--threads", options->threads, "Of the mapper and of Open3D", 1, 1024);
  command->add_option("--out", options->out, "Write the table into this folder as well");
  command->callback([=, &chosen] { chosen = [=] { return RunWholeBench(*options); }; });
}

void AddReleased(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<ReleasedOptions>();
  CLI::App* command = app.add_subcommand("released", "What docs/released.md shows, as CSV");
  command->add_option("--out", options->out, "Output folder")->capture_default_str();
  command->add_option("--scenes", options->scenes, "Some of them")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--settings", options->settings, "Some of the rows, by name; default: all")
      ->delimiter(',');
  command->callback([=, &chosen] { chosen = [=] { return RunReleased(*options); }; });
}

void AddScaling(CLI::App& app, Chosen& chosen) {
  const auto options = std::make_shared<ScalingOptions>();
  CLI::App* command = app.add_subcommand("scaling", "What docs/scaling.md shows, as CSV");
  command->add_option("--out", options->out, "Output folder")->capture_default_str();
  command->add_option("--parts", options->parts, "Some of them")
      ->delimiter(',')
      ->capture_default_str();
  AddCount(command, "--frames", options->frames, "Of the long runs, a multiple of 1000", 1000,
           10000000);
  AddCount(command, "--runs", options->runs, "Of the others", 1, 1000);
  command->callback([=, &chosen] { chosen = [=] { return RunScaling(*options); }; });
}

}  // namespace
}  // namespace tsdfpp

namespace {

int RunBench(int argc, char** argv) {
  // OpenMP's waiting threads would take the cores from whoever comes after Open3D; the library
  // reads this as it is loaded, so the program starts itself again.
  if (std::getenv("OMP_WAIT_POLICY") == nullptr) {
    setenv("OMP_WAIT_POLICY", "passive", 1);
    // Without it Open3D 0.16 does not heed omp_set_num_threads.
    setenv("OMP_NUM_THREADS", std::to_string(std::thread::hardware_concurrency()).c_str(), 0);
    execv("/proc/self/exe", argv);
  }
  tsdfpp::Chosen chosen;
  CLI::App app(
      "Measurements of the whole, each printed as a table; without a command Google "
      "Benchmark's of the kernels, with its options");
  app.require_subcommand(1);
  tsdfpp::AddSideBySide(app, chosen);
  tsdfpp::AddRender(app, chosen);
  tsdfpp::AddRays(app, chosen);
  tsdfpp::AddMesh(app, chosen);
  tsdfpp::AddFigures(app, chosen);
  tsdfpp::AddReleased(app, chosen);
  tsdfpp::AddSegment(app, chosen);
  tsdfpp::AddTrack(app, chosen);
  tsdfpp::AddTerms(app, chosen);
  tsdfpp::AddReturns(app, chosen);
  tsdfpp::AddMotion(app, chosen);
  tsdfpp::AddCamera(app, chosen);
  tsdfpp::AddScaling(app, chosen);
  tsdfpp::AddWhole(app, chosen);
  const std::vector<CLI::App*> commands = app.get_subcommands([](CLI::App*) { return true; });
  if (argc < 2 || std::none_of(commands.begin(), commands.end(), [&](const CLI::App* command) {
        return command->get_name() == argv[1];
      })) {
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    return 0;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    tsdfpp::PrintError("tsdfpp_bench",
                       fmt::format("{} (see tsdfpp_bench {} --help)", error.what(), argv[1]));
    return static_cast<int>(tsdfpp::ErrorKind::kUsage);
  }
  const auto done = chosen();
  if (!done) {
    tsdfpp::PrintError("tsdfpp_bench", done.error().message);
    return static_cast<int>(done.error().kind);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return tsdfpp::GuardedMain("tsdfpp_bench", [&] { return RunBench(argc, argv); });
}
