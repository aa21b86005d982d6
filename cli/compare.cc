#include "eval/compare/compare.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "cli/command.h"
#include "cli/mapping_options.h"
#include "cli/pose_choice.h"
#include "cli/segmentation_options.h"
#include "cli/sequence_options.h"
#include "eval/compare/compare_report.h"
#include "eval/compare/compare_tables.h"
#include "eval/run/open_source.h"
#include "eval/truth/stand_in_truth.h"

namespace tsdfpp {
namespace {

struct CompareArguments {
  SequenceArguments source;
  std::string out;
  std::string methods =
      "tsdf/static,tsdf,tsdf/guarded,tsdf++/literal,tsdf++,tsdf++/anchored,volumes";
  std::string profiles = "paper,close";
  std::string camera = "gt";
  std::string bleeding = "auto";
  RepairOptions repair;
  std::string poses;
  TrackingOptions tracking;
  std::string associate;
  std::string votes;
  SegmentationOptions segmentation{.segmentation = "gt"};
  std::vector<std::string> adapters;
  int reveal = -1;
  std::string removed;
  CompareConfig config;
};

// Half the map's voxel: what stands in for the truth is finer than what is compared with it.
constexpr double kStandInVoxels = 0.5;

// The source with the plan that was typed, or the paper's where a dataset of somebody else's has
// none; true surfaces are reconstructed where that has none.
Expected<std::unique_ptr<FrameSource>> WithExperiment(std::unique_ptr<FrameSource> source,
                                                      const CompareArguments& options,
                                                      CompareConfig& config) {
  const SequenceInfo& info = source->info();
  const bool foreign = IsForeignCofusion(options.source.path);
  if (options.reveal < 0 && options.removed.empty() && !foreign) return source;
  const int last = info.first_index + info.frame_count - 1;
  RevealPlan plan = info.reveal.value_or(PaperPlan(info));
  if (options.reveal >= 0) plan.frame = options.reveal;
  if (plan.frame < info.first_index || plan.frame > last) {
    return UsageError("--reveal {} is out of range: {} has frames {} to {}", plan.frame, info.name,
                      info.first_index, last);
  }
  int until = last;
  const std::string& text = options.config.until;
  std::from_chars(text.data(), text.data() + text.size(), until);
  if (options.reveal > until) {
    return UsageError("--reveal {} is after --until {}, expected a frame that is mapped",
                      options.reveal, until);
  }
  TSDFPP_ASSIGN(const std::vector<std::string> removed, NamesOf("--removed", options.removed));
  if (!removed.empty()) {
    TSDFPP_ASSIGN(plan.removed, FindObjects(info, removed));
  }
  if (std::find(plan.removed.begin(), plan.removed.end(), kBackground) != plan.removed.end()) {
    return UsageError("--removed names the background, which cannot be removed");
  }
  std::vector<TrueModel> models;
  if (foreign) {
    const double voxel_m = kStandInVoxels * config.map.voxel_m;
    ProgressBar bar("truth");
    TSDFPP_ASSIGN(models, ReconstructTruth(*source, voxel_m,
                                           [&](int done, int total) { bar.Show(done, total); }));
    config.truth = StandInOptions(voxel_m);
    config.truth_note = StandInNote(info, voxel_m);
    spdlog::info("{}", config.truth_note);
    spdlog::info("{}: reveal at frame {}, {} objects removed", info.name, plan.frame,
                 plan.removed.size());
  }
  return WithPlan(std::move(source), plan, std::move(models));
}

// The poses that were typed; else those that fit the source, the association and the methods.
std::string PoseNames(const CompareArguments& options, const CompareConfig& config,
                      const FrameSource& source) {
  if (!options.poses.empty()) return options.poses;
  const SequenceInfo& info = source.info();
  const PoseChoice choice = DefaultPoses(info, AssociationOf(config, info), config.methods);
  if (!choice.remark.empty()) spdlog::info("{}", choice.remark);
  return std::string(PoseSourceName(choice.poses));
}

// What is compared: maps of this program, and those of others.
Expected<void> ReadMappers(const CompareArguments& options, CompareConfig& config) {
  config.methods.clear();
  const std::vector<std::string> known = AdapterNames();
  for (const std::string& name : SplitList(options.methods)) {
    if (std::find(known.begin(), known.end(), name) != known.end()) {
      TSDFPP_ASSIGN(AdapterConfig adapter, FindAdapter(name));
      config.adapters.push_back(std::move(adapter));
      continue;
    }
    TSDFPP_ASSIGN(const Method method, MethodFromName(name));
    config.methods.push_back(method);
  }
  for (const std::string& file : options.adapters) {
    TSDFPP_ASSIGN(AdapterConfig adapter, ReadAdapter(file));
    config.adapters.push_back(std::move(adapter));
  }
  for (const AdapterConfig& adapter : config.adapters) {
    const auto same = [&](const AdapterConfig& other) { return other.name == adapter.name; };
    if (std::count_if(config.adapters.begin(), config.adapters.end(), same) > 1) {
      return UsageError("two adapters have the name {}", adapter.name);
    }
  }
  return {};
}

Expected<void> ReadPoses(const std::string& names, CompareConfig& config) {
  config.poses.clear();
  for (const std::string& name : SplitList(names)) {
    TSDFPP_ASSIGN(const PoseSource poses, PoseSourceFromName(name));
    for (const Method method : config.methods) {
      TSDFPP_RETURN_IF_ERROR(CheckPoses(method, poses));
      TSDFPP_RETURN_IF_ERROR(CheckCamera(method, config.camera));
    }
    config.poses.push_back(poses);
  }
  return {};
}

// What is tracked, and how, where something is.
Expected<void> ChooseTracking(const CompareArguments& options, CompareConfig& config) {
  TSDFPP_ASSIGN(const TrackWishes wishes, ReadTracking(options.tracking));
  TSDFPP_RETURN_IF_ERROR(CheckTracking(wishes, config.poses, config.camera));
  config.tracked = wishes.tracked;
  if (wishes.config) config.track = *wishes.config;
  return {};
}

// Whether each list has something, and nothing twice, and the profiles fit the voxels.
Expected<void> CheckLists(const CompareArguments& options, const std::string& pose_names,
                          const CompareConfig& config) {
  if ((config.methods.empty() && config.adapters.empty()) || config.profiles.empty() ||
      config.poses.empty()) {
    return UsageError("--methods, --profiles and --poses each need one name at least");
  }
  for (const auto& [option, list] :
       {std::pair{"--methods", &options.methods}, std::pair{"--profiles", &options.profiles},
        std::pair{"--poses", &pose_names}}) {
    const std::vector<std::string> names = SplitList(*list);
    for (const std::string& name : names) {
      if (std::count(names.begin(), names.end(), name) > 1) {
        return UsageError("{} names {} twice", option, name);
      }
    }
  }
  // A method may have a short name, too.
  for (const Method method : config.methods) {
    if (std::count(config.methods.begin(), config.methods.end(), method) > 1) {
      return UsageError("--methods names {} twice", MethodName(method));
    }
  }
  for (const std::string& profile : config.profiles) {
    MapConfig probe = config.map;
    TSDFPP_RETURN_IF_ERROR(probe.SetProfile(profile));
    TSDFPP_RETURN_IF_ERROR(probe.Validate());
  }
  return {};
}

// The options that were given of how our maps are made, as on a command line, each with a space
// before; those aside whose defaults depend on the source.
std::string MapOptionsText(const CompareArguments& options) {
  std::string text;
  if (options.camera != CameraSourceName(CameraSource::kGiven)) {
    text += " --camera " + options.camera;
  }
  if (options.bleeding != BleedingPixelsName(BleedingPixels::kAuto)) {
    text += " --bleeding " + options.bleeding;
  }
  text += options.repair.Text() + options.tracking.Text();
  if (const std::string& name = options.segmentation.segmentation;
      name != SegmentationName(Segmentation::kGiven)) {
    text += " --segmentation " + name;
  }
  text += options.segmentation.Text();
  if (!options.associate.empty()) text += " --associate " + options.associate;
  if (!options.votes.empty()) text += " --vote-config " + options.votes;
  return text;
}

// With adapters alone there is no map of ours that options could be of.
Expected<void> CheckAdaptersAlone(const CompareArguments& options, const CompareConfig& config) {
  if (!config.methods.empty() || config.adapters.empty()) return {};
  std::string text = MapOptionsText(options);
  if (!options.poses.empty()) text += " --poses " + options.poses;
  if (config.keep_meshes) text += " --keep-meshes";
  if (config.record) text += " --record";
  if (text.empty()) return {};
  return UsageError("'{}' is of our own maps, and --methods names none of them", text.substr(1));
}

// The command with what was given.
std::string CommandText(const CompareArguments& options, const CompareConfig& config,
                        const std::string& pose_names) {
  std::string command =
      fmt::format("tsdfpp compare {} --out {} --methods {} --profiles {}", TextOf(options.source),
                  options.out, options.methods.empty() ? "''" : options.methods, options.profiles);
  if (!config.methods.empty()) command += " --poses " + pose_names;
  command += fmt::format(" --voxel {} --every {} --until {}{}{}", config.map.voxel_m, config.every,
                         config.until, config.keep_meshes ? " --keep-meshes" : "",
                         config.record ? " --record" : "");
  if (options.reveal >= 0) command += fmt::format(" --reveal {}", options.reveal);
  if (!options.removed.empty()) command += " --removed " + options.removed;
  command += MapOptionsText(options);
  for (const std::string& file : options.adapters) command += " --adapter " + file;
  return command;
}

void LogRemarks(const CompareResult& result) {
  for (const auto& run : result.runs) {
    for (const std::string& remark : run->pipeline.Remarks()) {
      spdlog::warn("{}: {}", run->Title(), remark);
    }
  }
  for (const std::string& line : FailureLines(result)) spdlog::error("{}", line);
}

// What was finished is the result; that something was not decides the exit code.
CommandResult ResultOf(const CompareResult& result, const std::string& out,
                       const std::string& command) {
  int exit_code = 0;
  std::string complaint;
  if (!result.failed.empty()) {
    exit_code = static_cast<int>(result.failed.front().error.kind);
    complaint = fmt::format("{} of {} maps failed, {} has what the others did",
                            result.failed.size(), result.failed.size() + result.runs.size(), out);
  }
  if (result.stopped) {
    exit_code = static_cast<int>(result.stopped->kind);
    complaint = fmt::format("the frames ended after frame {}, {} has what was done until then",
                            result.last_frame, out);
  }
  return {SummaryJson(result, command),
          FrontTable(result) + SummaryTable(result) +
              fmt::format("report: {}/report.html ({:.0f} s)\n", out, result.total_s),
          exit_code, complaint};
}

// Where the masks of our maps come from.
Expected<void> ReadSegmentation(const CompareArguments& options, CompareConfig& config) {
  TSDFPP_ASSIGN(config.segmentation, SegmentationFromName(options.segmentation.segmentation));
  TSDFPP_ASSIGN(config.segmenter, ReadSegmenterParts(options.segmentation, config.segmentation));
  return {};
}

Expected<CommandResult> RunCompareCommand(const CompareArguments& options) {
  CompareConfig config = options.config;
  TSDFPP_RETURN_IF_ERROR(ReadMappers(options, config));
  TSDFPP_RETURN_IF_ERROR(CheckAdaptersAlone(options, config));
  TSDFPP_RETURN_IF_ERROR(ReadSegmentation(options, config));
  config.profiles = SplitList(options.profiles);
  if (!options.associate.empty()) {
    TSDFPP_ASSIGN(config.associate, AssociationModeFromName(options.associate));
  }
  TSDFPP_ASSIGN(const std::optional<VoteConfig> votes, ReadVotes(options.votes));
  TSDFPP_ASSIGN(MaskedSource opened, OpenForScores(options.source));
  TSDFPP_RETURN_IF_ERROR(CheckVotes(votes, AssociationOf(config, opened.source->info())));
  if (votes) config.votes = *votes;
  TSDFPP_ASSIGN(config.camera, CameraSourceFromName(options.camera));
  TSDFPP_ASSIGN(config.bleeding, BleedingPixelsFromName(options.bleeding));
  TSDFPP_ASSIGN(const RepairWishes repair, ReadRepair(options.repair));
  config.mask_repair = repair.mode;
  config.repair = repair.config;
  const std::string pose_names = PoseNames(options, config, *opened.source);
  TSDFPP_RETURN_IF_ERROR(ReadPoses(pose_names, config));
  TSDFPP_RETURN_IF_ERROR(ChooseTracking(options, config));
  TSDFPP_RETURN_IF_ERROR(CheckLists(options, pose_names, config));
  TSDFPP_ASSIGN(auto source, WithExperiment(std::move(opened.source), options, config));
  if (!opened.remark.empty()) {
    config.truth_note += (config.truth_note.empty() ? "" : " ") + opened.remark;
  }
  const std::string command = CommandText(options, config, pose_names);
  ProgressBar bar("compare");
  const auto show = [&](int done, int total) { bar.Show(done, total); };
  TSDFPP_ASSIGN(const CompareResult result,
                RunCompare(*source, config, options.out, command, show));
  LogRemarks(result);
  return ResultOf(result, options.out, command);
}

}  // namespace

Run AddCompare(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<CompareArguments>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source);
  app.add_option("--out", options->out, "Output folder")->check(NotEmpty("a folder"))->required();
  app.add_option("--methods", options->methods,
                 fmt::format("Maps to compare, by commas: {}; {}", MethodNames(),
                             fmt::join(AdapterNames(), ", ")))
      ->capture_default_str();
  app.add_option("--profiles", options->profiles, "Truncation profiles: paper, close")
      ->capture_default_str();
  AddSegmentationOptions(app,
                         "Where the masks of our maps come from: gt (the sequence), none (all is "
                         "background),",
                         options->segmentation);
  AddDepthConfigOption(app, options->segmentation);
  app.add_option("--associate", options->associate,
                 "Which objects segments are: given (the masks' ids) or votes (their points vote; "
                 "ids are the map's own and matched to the truth's by overlap, each once); by "
                 "default given unless ids are drawn anew in every frame")
      ->check(OneOf({"given", "votes"}));
  AddVoteOption(app, options->votes);
  app.add_option("--bleeding", options->bleeding,
                 "For our maps, pixels beside an outline with the depth of its other side: keep "
                 "(mapped like others), wait (left out of the frame), auto (wait where objects or "
                 "the camera are tracked by signed distances)")
      ->check(OneOf({"auto", "keep", "wait"}))
      ->capture_default_str();
  AddRepairOptions(app, options->repair);
  app.add_option("--camera", options->camera,
                 "Camera poses of our maps: gt (given), refine (given and then corrected by the "
                 "map's background), track (the first one given, the others found by it)")
      ->check(OneOf({"gt", "refine", "track"}))
      ->capture_default_str();
  app.add_option(
         "--poses", options->poses,
         std::string("Object poses: gt (given), icp or track (tracked, docs/tracking.md); ") +
             kDefaultPosesHelp)
      ->check(NotEmpty("one of gt, icp and track at least"));
  AddTrackingOptions(app, options->tracking);
  app.add_option("--voxel", options->config.map.voxel_m, "Voxel size, metres")
      ->capture_default_str();
  app.add_option("--every", options->config.every, "Frames between evaluations")
      ->check(AboveZero())
      ->capture_default_str();
  app.add_option("--until", options->config.until,
                 "Where to stop: reveal, end, or a frame's number")
      ->capture_default_str();
  app.add_option("--reveal", options->reveal,
                 "Frame after which objects are removed, in place of the sequence's own plan")
      ->check(WholeBetween(0, 1'000'000));
  app.add_option("--removed", options->removed,
                 "Those objects, ids or names, by commas, in place of the sequence's own plan");
  app.add_option("--adapter", options->adapters,
                 "Another mapper to compare (docs/adapters.md); may be given several times")
      ->check(NotEmpty("a .toml file"));
  app.add_flag("--keep-meshes", options->config.keep_meshes,
               "Write every evaluated frame's meshes, as `tsdfpp evaluate` reads them");
  app.add_flag("--record", options->config.record,
               "Keep what the 3-D view of `tsdfpp report` shows, below OUT/record/");
  return [options] { return RunCompareCommand(*options); };
}

}  // namespace tsdfpp
