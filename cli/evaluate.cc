#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <charconv>
#include <memory>

#include "cli/command.h"
#include "cli/sequence_options.h"
#include "eval/run/open_source.h"
#include "eval/score/evaluate_meshes.h"

namespace tsdfpp {
namespace {

struct EvaluateArguments {
  SequenceArguments source;
  std::string meshes;
  std::string trajectories;
  std::string masks;
  std::string at;
  std::string removed;
  std::string match = "names";
  EvaluateConfig config;
};

Expected<CommandResult> RunEvaluateCommand(const EvaluateArguments& options, bool scale_is_given) {
  EvaluateConfig config = options.config;
  config.meshes = options.meshes;
  if (!options.trajectories.empty()) config.trajectories = options.trajectories;
  if (!options.masks.empty()) config.masks = options.masks;
  config.scale_is_given = scale_is_given;
  TSDFPP_ASSIGN(config.match, MatchModeFromName(options.match));
  for (const std::string& word : SplitList(options.at)) {
    int frame = 0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), frame);
    if (status != std::errc() || end != word.data() + word.size()) {
      return UsageError("--at '{}': expected frames' numbers between commas, found '{}'",
                        options.at, word);
    }
    config.frames.push_back(frame);
  }
  TSDFPP_ASSIGN(const std::vector<std::string> names, NamesOf("--removed", options.removed));
  TSDFPP_ASSIGN(MaskedSource opened, OpenForScores(options.source));
  FrameSource* const source = opened.source.get();
  TSDFPP_ASSIGN(const std::vector<InstanceId> removed, FindObjects(source->info(), names));
  config.removed = {removed.begin(), removed.end()};
  ProgressBar bar("evaluate");
  TSDFPP_ASSIGN(const EvaluateResult result,
                RunEvaluate(*source, config, [&](int done, int total) { bar.Show(done, total); }));
  for (const EvaluatedFrame& frame : result.frames) {
    for (const std::string& remark : frame.remarks) {
      spdlog::warn("frame {}: {}", frame.evaluation.frame, remark);
    }
  }
  if (result.trajectories) {
    for (const std::string& remark : result.trajectories->remarks) spdlog::warn("{}", remark);
  }
  if (result.masks) {
    for (const std::string& remark : result.masks->remarks) spdlog::warn("{}", remark);
  }
  return CommandResult{ToJson(result), EvaluateTable(result)};
}

}  // namespace

Run AddEvaluate(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<EvaluateArguments>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source);
  app.add_option("--meshes", options->meshes, "Folder of meshes (docs/evaluate.md)")
      ->check(NotEmpty("a folder"))
      ->required();
  app.add_option("--at", options->at, "Frames after which the meshes were made, by commas")
      ->required();
  app.add_option("--removed", options->removed,
                 "Objects that the experiment removes, ids or names, by commas");
  app.add_option("--trajectories", options->trajectories, "Folder of trajectories")
      ->check(NotEmpty("a folder"));
  app.add_option("--masks", options->masks, "Folder of masks")->check(NotEmpty("a folder"));
  CLI::Option* scale = app.add_option("--scale", options->config.scale,
                                      "Metres a unit of the meshes, 0.001 for millimetres")
                           ->check(AboveZero())
                           ->capture_default_str();
  app.add_option("--match", options->match,
                 "names: take names and labels that the sequence has; overlap: take none")
      ->check(OneOf({"names", "overlap"}))
      ->capture_default_str();
  app.add_option("--voxel", options->config.voxel_m, "Threshold of the scores, metres")
      ->check(AboveZero())
      ->capture_default_str();
  app.add_option("--density", options->config.truth.sampling.fine_per_cm2,
                 "Samples a cm2 of the true surfaces of table and objects")
      ->check(Between(0.01, 1000))
      ->capture_default_str();
  return [options, scale] { return RunEvaluateCommand(*options, scale->count() > 0); };
}

}  // namespace tsdfpp
