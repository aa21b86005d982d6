#include "eval/make/generate.h"

#include <fmt/format.h>

#include <limits>
#include <thread>

#include "cli/command.h"
#include "cli/stop_on_signal.h"
#include "core/folders.h"
#include "core/intrinsics.h"
#include "eval/make/scene_page.h"
#include "sim/load_scene.h"
#include "sim/scene_list.h"

namespace tsdfpp {
namespace {

struct GenerateArguments {
  std::string scene;
  std::string out;
  std::string sensor;
  std::string scenes = "scenes";
  std::string page;
  bool list = false;
  std::uint64_t seed = 0;
  CLI::Option* seed_given = nullptr;
  std::vector<const CLI::Option*> of_rendering;  // without effect beside --list and --page
  double scale = 1;
  GenerateOptions generate;
};

Expected<CommandResult> ListScenes(const GenerateArguments& options) {
  TSDFPP_ASSIGN(const std::vector<SceneFile> scenes, SceneFiles(options.scenes));
  CommandResult result{nlohmann::json::array(), ""};
  for (const SceneFile& scene : scenes) {
    result.json.push_back({{"file", scene.path.string()},
                           {"name", scene.name},
                           {"purpose", scene.purpose},
                           {"frames", scene.frames},
                           {"rate_hz", scene.rate_hz},
                           {"width", scene.width},
                           {"height", scene.height},
                           {"random", scene.random}});
    result.text +=
        fmt::format("{:<16} {:>5} frames {:>4}x{:<4} {}{}\n", scene.name, scene.frames, scene.width,
                    scene.height, scene.purpose, scene.random ? " (--seed)" : "");
  }
  return result;
}

Expected<CommandResult> WritePage(const GenerateArguments& options) {
  {
    ProgressBar bar("scenes");
    TSDFPP_RETURN_IF_ERROR(WriteScenePage(options.scenes, options.page,
                                          [&](int done, int total) { bar.Show(done, total); }));
  }
  const std::string file = (std::filesystem::path(options.page) / "scenes.md").string();
  return CommandResult{{{"page", file}}, file + "\n"};
}

std::string Summary(const GenerateArguments& options, const GenerateResult& made) {
  std::string text =
      fmt::format("{}: {} frames of {} in {:.1f} s ({:.1f} frames/s, {} jobs; {}, {})\n",
                  options.out, made.info.frame_count, made.info.name, made.render_s,
                  (made.info.frame_count - made.resumed_frames) / std::max(made.render_s, 1e-9),
                  made.jobs, made.gl.backend, made.gl.renderer);
  if (made.resumed_frames > 0) {
    text += fmt::format("{} of them were there from an interrupted run\n", made.resumed_frames);
  }
  return text + fmt::format("verified in {:.1f} s; ", made.verify_s) +
         CertifyText(made.certificate);
}

Expected<CommandResult> RunGenerate(const GenerateArguments& options) {
  const bool page = !options.page.empty();
  for (const CLI::Option* option : options.of_rendering) {
    if ((options.list || page) && option->count() > 0) {
      return UsageError("{} has no effect beside {}, expected it with a SCENE", option->get_name(),
                        page ? "--page" : "--list");
    }
  }
  if (options.list) return ListScenes(options);
  if (page) return WritePage(options);
  if (options.scene.empty()) return UsageError("SCENE is required (see tsdfpp generate --help)");
  if (options.out.empty()) return UsageError("--out is required (see tsdfpp generate --help)");
  std::optional<std::uint64_t> seed;
  if (options.seed_given->count() > 0) seed = options.seed;
  if (IsFolder(options.scene)) {
    return UsageError("{}: is a folder, expected a scene file (.toml)", options.scene);
  }
  if (std::filesystem::path(options.scene).extension() == ".xml") {
    return UsageError(
        "{}: is MJCF or other XML, expected a scene file (.toml, docs/scene-files.md)",
        options.scene);
  }
  TSDFPP_ASSIGN(SceneConfig scene, LoadSceneConfig(options.scene, seed));
  if (!options.sensor.empty()) {
    TSDFPP_ASSIGN(scene.sensor, SensorPresetNamed(options.sensor));
  }
  scene.intrinsics = Scaled(scene.intrinsics, options.scale);
  GenerateOptions generate = options.generate;
  generate.out = options.out;
  generate.stop = &StopOnSignal::stop();
  if (generate.jobs == 0) {
    generate.jobs = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
  Expected<GenerateResult> made;
  {
    const StopOnSignal handler;
    std::optional<ProgressBar> bar;
    std::string shown;
    generate.progress = [&](const std::string& phase, int done, int resumed, int total) {
      if (phase != shown) bar.emplace(phase);
      shown = phase;
      bar->Show(done, total, resumed);
    };
    made = GenerateSequence(scene, TSDFPP_VERSION, generate);
  }
  if (!made && StopOnSignal::stop()) StopOnSignal::Die(made.error());
  if (!made) return tl::unexpected(made.error());
  const double seconds = std::max(made->render_s, 1e-9);
  return CommandResult{{{"scene", made->info.name},
                        {"frames", made->info.frame_count},
                        {"resumed_frames", made->resumed_frames},
                        {"jobs", made->jobs},
                        {"out", options.out},
                        {"backend", made->gl.backend},
                        {"renderer", made->gl.renderer},
                        {"render_s", made->render_s},
                        {"frames_per_s", (made->info.frame_count - made->resumed_frames) / seconds},
                        {"verify_s", made->verify_s},
                        {"certificate", CertifyJson(made->certificate)}},
                       Summary(options, *made)};
}

}  // namespace

Run AddGenerate(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<GenerateArguments>();
  options->generate.jobs = 0;
  CLI::Option* scene = app.add_option("SCENE", options->scene, "Scene file (.toml)");
  CLI::Option* out = app.add_option("--out", options->out, "Folder of the new sequence")
                         ->check(NotEmpty("a folder"));
  CLI::Option* overwrite = app.add_flag("--overwrite", options->generate.overwrite,
                                        "Replace an earlier sequence of ours");
  CLI::Option* jobs =
      app.add_option("--jobs", options->generate.jobs,
                     "Processes that render; one a core by default. The bytes do not depend on it")
          ->check(WholeBetween(1, 256));
  options->seed_given = app.add_option(
      "--seed", options->seed, "Replaces the scene's seed: of random scenes, jitter, sensor");
  // TOML's integers end there, and the seed is written into scene.toml.
  options->seed_given->check(WholeBetween(0, std::numeric_limits<std::int64_t>::max()));
  CLI::Option* sensor =
      app.add_option("--sensor", options->sensor,
                     "Ready-made sensor in place of the scene's own, or several joined by '+' "
                     "(docs/sensors.md)")
          ->check(NotEmpty("the name of a sensor"));
  CLI::Option* scale =
      app.add_option("--scale", options->scale, "Images this many times the scene's size")
          ->check(Between(0.05, 4.0))
          ->capture_default_str();
  CLI::Option* jagged = app.add_flag_callback(
      "--no-antialias", [options] { options->generate.render.antialias = false; },
      "Colour without multisampling: jagged edges, faster");
  CLI::Option* share = app.add_option("--share", options->generate.ray_share,
                                      "Share of the frames that are compared with rays before the "
                                      "sequence is published")
                           ->check(Between(0, 1))
                           ->capture_default_str();
  options->of_rendering = {overwrite, jobs, options->seed_given, sensor, scale, jagged, share};
  CLI::Option* list =
      app.add_flag("--list", options->list, "List the scenes of --scenes and what they are for");
  CLI::Option* page =
      app.add_option("--page", options->page,
                     "Write scenes.md with pictures of the scenes of --scenes into this folder");
  list->excludes(page);
  for (CLI::Option* other : {scene, out}) {
    list->excludes(other);
    page->excludes(other);
  }
  app.add_option("--scenes", options->scenes, "Folder that --list and --page look at")
      ->capture_default_str()
      ->excludes(scene);
  return [options] { return RunGenerate(*options); };
}

}  // namespace tsdfpp
