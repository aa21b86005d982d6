#include "eval/sweep/replay.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cli/command.h"

namespace tsdfpp {
namespace {

Expected<CommandResult> RunReplay(const ReplayOptions& options) {
  ReplayOptions replay = options;
  if (replay.out.empty()) {
    replay.out =
        std::filesystem::path("out") / "replay" / fmt::format("{}-{}", options.cell, options.frame);
  }
  ProgressBar bar("replay");
  replay.progress = [&](int done, int total) { bar.Show(done, total); };
  TSDFPP_ASSIGN(const ReplayResult result, Replay(replay));
  nlohmann::json json{{"cell", result.cell},
                      {"frame", options.frame},
                      {"settings", SettingsJson(result.settings)},
                      {"out", replay.out.string()},
                      {"files", result.files},
                      {"image_digest", result.image_digest},
                      {"map_digest", result.map_digest}};
  json["compared_map_frame"] =
      result.compared_map_frame ? nlohmann::json(*result.compared_map_frame) : nullptr;
  const std::string map = result.compared_map_frame ? fmt::format("and the map at frame {} are",
                                                                  *result.compared_map_frame)
                                                    : std::string("are");
  return CommandResult{
      std::move(json),
      fmt::format("{}: frame {} of cell {} ({}), {} frames mapped; its images {} those of the "
                  "original run\n",
                  replay.out.string(), options.frame, result.cell, result.settings.method,
                  result.frames, map)};
}

}  // namespace

Run AddReplay(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<ReplayOptions>();
  app.add_option("RESULT", options->result, "An experiment's folder, or its results.json")
      ->required();
  app.add_option("--cell", options->cell, "Id of a cell (results.csv), or its beginning")
      ->check(NotEmpty("the id of a cell"))
      ->required();
  app.add_option("--frame", options->frame, "Number of a frame that the cell used")
      ->check(NotNegative())
      ->required();
  app.add_option("--out", options->out, "Output folder; by default out/replay/<cell>-<frame>")
      ->check(NotEmpty("a folder"));
  AddFollowLinks(app);
  return [options] { return RunReplay(*options); };
}

}  // namespace tsdfpp
