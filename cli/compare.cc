#include "eval/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "cli/command.h"
#include "cli/sequence_options.h"
#include "eval/compare_report.h"

namespace tsdfpp {
namespace {

struct Options {
  SequenceArguments source;
  std::string out;
  std::string methods = "tsdf,tsdf++,tsdf++/anchored";
  std::string profiles = "paper,close";
  std::string poses = "gt";
  CompareConfig config;
};

Expected<CommandResult> RunCompareCommand(const Options& options) {
  CompareConfig config = options.config;
  config.methods.clear();
  for (const std::string& name : SplitList(options.methods)) {
    TSDFPP_ASSIGN(const Method method, MethodFromName(name));
    config.methods.push_back(method);
  }
  config.profiles = SplitList(options.profiles);
  config.poses.clear();
  for (const std::string& name : SplitList(options.poses)) {
    TSDFPP_ASSIGN(const PoseSource poses, PoseSourceFromName(name));
    config.poses.push_back(poses);
  }
  if (config.methods.empty() || config.profiles.empty() || config.poses.empty()) {
    return UsageError("--methods, --profiles and --poses each need one name at least");
  }
  for (const auto& [option, list] :
       {std::pair{"--methods", &options.methods}, std::pair{"--profiles", &options.profiles},
        std::pair{"--poses", &options.poses}}) {
    const std::vector<std::string> names = SplitList(*list);
    for (const std::string& name : names) {
      if (std::count(names.begin(), names.end(), name) > 1) {
        return UsageError("{} names {} twice", option, name);
      }
    }
  }
  for (const std::string& profile : config.profiles) {
    MapConfig probe = config.map;
    TSDFPP_RETURN_IF_ERROR(probe.SetProfile(profile));
    TSDFPP_RETURN_IF_ERROR(probe.Validate());
  }
  TSDFPP_ASSIGN(auto source, OpenArguments(options.source));
  const std::string command = fmt::format(
      "tsdfpp compare {} --out {} --methods {} --profiles {} --poses {} --voxel {} --every {} "
      "--until {}{}",
      TextOf(options.source), options.out, options.methods, options.profiles, options.poses,
      config.map.voxel_m, config.every, config.until, config.record ? " --record" : "");
  ProgressBar bar("compare");
  const auto show = [&](int done, int total) { bar.Show(done, total); };
  TSDFPP_ASSIGN(const CompareResult result,
                RunCompare(*source, config, options.out, command, show));
  return CommandResult{SummaryJson(result, command),
                       SummaryTable(result) + fmt::format("report: {}/report.html ({:.0f} s)\n",
                                                          options.out, result.total_s)};
}

}  // namespace

Run AddCompare(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<Options>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source);
  app.add_option("--out", options->out, "Output folder")->check(NotEmpty("a folder"))->required();
  app.add_option("--methods", options->methods,
                 "Maps to compare, by commas: tsdf, tsdf/min, tsdf++, tsdf++/literal, "
                 "tsdf++/anchored, volumes")
      ->capture_default_str();
  app.add_option("--profiles", options->profiles, "Truncation profiles: paper, close")
      ->capture_default_str();
  app.add_option("--poses", options->poses, "Object poses: gt (given), icp (tracked)")
      ->capture_default_str();
  app.add_option("--voxel", options->config.map.voxel_m, "Voxel size, metres")
      ->capture_default_str();
  app.add_option("--every", options->config.every, "Frames between evaluations")
      ->check(AboveZero())
      ->capture_default_str();
  app.add_option("--until", options->config.until,
                 "Where to stop: reveal, end, or a frame's number")
      ->capture_default_str();
  app.add_flag("--record", options->config.record,
               "Keep what the 3-D view of `tsdfpp report` shows, below OUT/record/");
  return [options] { return RunCompareCommand(*options); };
}

}  // namespace tsdfpp
