// The command `tsdfpp`. Exit codes: core/error.h; 0 where all went well.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <sstream>

#include "cli/command.h"
#include "cli/log_lines.h"
#include "cli/openmp_threads.h"
#include "cli/report.h"
#include "cli/segment.h"
#include "core/guard.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "mapper/kernels.h"

namespace {

using tsdfpp::CommonOptions;
using tsdfpp::ErrorKind;

constexpr std::size_t kMostOfAnOption = 300;  // shown of what was typed

// Returns `exit_code`, or another one where the text cannot be printed.
int Print(const std::string& text, int exit_code) {
  if (std::fputs(text.c_str(), stdout) >= 0 && std::fflush(stdout) == 0) return exit_code;
  tsdfpp::PrintError("tsdfpp",
                     fmt::format("the result cannot be printed ({})", std::strerror(errno)));
  return static_cast<int>(ErrorKind::kEnvironment);
}

// Registers the subcommands; returns what each runs once its options are parsed.
std::map<const CLI::App*, tsdfpp::Run> AddSubcommands(CLI::App& app, CommonOptions& common) {
  std::map<const CLI::App*, tsdfpp::Run> runs;
  const auto add = [&](const char* name, const char* help, const auto& function) {
    CLI::App* command = app.add_subcommand(name, help);
    command->add_flag("--json", common.json, "Print the result as JSON on stdout");
    command->add_option("--threads", common.threads, "Worker threads; all cores by default")
        ->check(tsdfpp::WholeBetween(1, 1024));
    runs[command] = function(*command, common);
    return command;
  };
  const auto add_with_kernels = [&](const char* name, const char* help, const auto& function) {
    add(name, help, function)
        ->add_option(
            "--kernels", common.kernels,
            "The mapper's inner loops: simd (vectors) or plain (voxel by voxel, pixel by pixel, "
            "slower); the results are the same")
        ->check(tsdfpp::OneOf({"simd", "plain"}))
        ->capture_default_str();
  };
  add("doctor", "Say what this machine has and what is missing", tsdfpp::AddDoctor);
  add("generate", "Render a scene to a sequence on disk", tsdfpp::AddGenerate);
  add("verify", "Check a sequence of ours against itself and against rays", tsdfpp::AddVerify);
  add("export", "Write a sequence or a scene in another dataset's format", tsdfpp::AddExport);
  add_with_kernels("map", "Map a sequence or a scene and write the meshes", tsdfpp::AddMap);
  add_with_kernels("segment", "Write the segments of each frame as images of ids",
                   tsdfpp::AddSegment);
  add("methods", "List the methods that map knows", tsdfpp::AddMethods);
  add_with_kernels("compare", "Run the paper's experiment on a scene or a sequence",
                   tsdfpp::AddCompare);
  add("evaluate", "Score the meshes that any mapper wrote, against a sequence's truth",
      tsdfpp::AddEvaluate);
  add("report", "Make a page of what compare wrote, in one HTML file", tsdfpp::AddReport);
  add("metric", "Measure files against true ones: trajectories, surfaces, masks, poses",
      tsdfpp::AddMetric);
  add_with_kernels("sweep", "Run an experiment: methods, scenes, seeds and settings, paired",
                   tsdfpp::AddSweep);
  add_with_kernels("replay", "Make one frame of an experiment's cell again", tsdfpp::AddReplay);
  add_with_kernels("bench-set", "Describe or run a frozen benchmark, or print its leaderboard",
                   tsdfpp::AddBenchSet);
  add_with_kernels("gate", "Run accuracy gates and say which hold", tsdfpp::AddGate);
  return runs;
}

// What is wrong with the words, as one sentence that says where help is.
std::string Complaint(const CLI::App& app, const CLI::ParseError& error) {
  // CLI11 misses the subcommand before it looks at the word that is none.
  const CLI::App* deepest = &app;
  while (!deepest->get_subcommands().empty()) deepest = deepest->get_subcommands().front();
  const std::vector<std::string> unknown = deepest->remaining();
  const std::string what = deepest->get_require_subcommand_min() > 0 && !unknown.empty()
                               ? "'" + unknown.front() + "' is no subcommand or option"
                               : error.what();
  const auto used = app.get_subcommands();
  const std::string command = used.empty() ? "tsdfpp" : "tsdfpp " + used.front()->get_name();
  return fmt::format("{} (see {} --help)", tsdfpp::OneLine(what, kMostOfAnOption), command);
}

int RunCommand(int argc, char** argv) {
  CLI::App app("tsdfpp: measures what maps keep of surfaces that they can no longer see", "tsdfpp");
  app.set_version_flag("--version", TSDFPP_VERSION);
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "Help of all subcommands");
  CommonOptions common;
  const auto runs = AddSubcommands(app, common);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    std::ostringstream text;
    app.exit(help, text);
    return Print(text.str(), 0);
  } catch (const CLI::ParseError& error) {
    tsdfpp::PrintError("tsdfpp", Complaint(app, error));
    return static_cast<int>(ErrorKind::kUsage);
  }
  tsdfpp::UseKernels(tsdfpp::KernelsFromName(common.kernels).value());
  std::unique_ptr<tbb::global_control> limit;
  if (common.threads > 0) {
    limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                  static_cast<std::size_t>(common.threads));
  }
  const auto result = runs.at(app.get_subcommands().front())();
  if (!result) {
    tsdfpp::PrintError("tsdfpp", result.error().message);
    return static_cast<int>(result.error().kind);
  }
  const std::string text = common.json ? tsdfpp::JsonText(result->json, 2) + "\n" : result->text;
  const int exit_code = Print(text, result->exit_code);
  if (!result->complaint.empty()) tsdfpp::PrintError("tsdfpp", result->complaint);
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  tsdfpp::LimitOpenMpThreads();
  return tsdfpp::GuardedMain("tsdfpp", [&] {
    tsdfpp::LogOneLineEach();
    return RunCommand(argc, argv);
  });
}
