#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <ctime>

#include "cli/command.h"
#include "cli/sweep_progress.h"
#include "core/files.h"
#include "eval/gate/gate_audit.h"
#include "eval/gate/gate_explain.h"
#include "eval/gate/gate_report.h"
#include "eval/gate/gate_run.h"

namespace tsdfpp {
namespace {

constexpr int kFreshSeeds = 20;
constexpr std::uint64_t kFirstFreshSeed = 1001;

struct GateArguments {
  std::string gates;
  std::string profile = "quick";
  std::string sabotage = "none";
  bool sabotages = false;
  bool audit = false;
  std::string explain;
  bool update = false;
  std::string reason;
  std::string out;
  int jobs = 0;
};

bool WantsColour() {
  const char* no_colour = std::getenv("NO_COLOR");
  return isatty(STDOUT_FILENO) == 1 && (no_colour == nullptr || *no_colour == '\0');
}

std::string DateNow() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d", &utc);
  return text;
}

Expected<void> Check(const GateArguments& options) {
  if (options.update && options.reason.empty()) {
    return UsageError("--update needs --reason TEXT, which goes into the references");
  }
  if (!options.update && !options.reason.empty()) {
    return UsageError("--reason goes with --update alone");
  }
  if (options.sabotage != "none" && (options.update || options.sabotages || options.audit)) {
    return UsageError("--sabotage does not go with {}", options.update      ? "--update"
                                                        : options.sabotages ? "--sabotages"
                                                                            : "--audit");
  }
  const int ways = static_cast<int>(options.update) + static_cast<int>(options.audit) +
                   static_cast<int>(!options.explain.empty());
  if (ways > 1) return UsageError("--update, --audit and --explain exclude each other");
  if (options.sabotages && ways > 0) {
    return UsageError("--sabotages does not go with --update, --audit or --explain");
  }
  return {};
}

Expected<CommandResult> Update(const GateArguments& options, const GateRun& run,
                               const References& before) {
  if (!run.controls_hold()) {
    return DataError("{}: a control fails, so there is nothing to refer to", options.gates);
  }
  const std::string command =
      fmt::format("tsdfpp gate {} --profile {} --update", options.gates, options.profile);
  const References after = UpdatedReferences(before, run, command, options.reason, DateNow());
  const std::string difference = ReferencesDifference(before, after);
  // Shown whether or not the writing goes well.
  std::fputs(difference.empty() ? "no value differs\n" : difference.c_str(), stderr);
  TSDFPP_RETURN_IF_ERROR(SaveReferences(after, run.config.references));
  return CommandResult{{{"references", run.config.references.string()}, {"difference", difference}},
                       fmt::format("{}: written\n", run.config.references.string())};
}

Expected<CommandResult> Audit(const GatesConfig& config, const References& references,
                              GateOptions& gate) {
  TSDFPP_ASSIGN(const std::vector<GateAudit> audits, WithSweepBar("gate", gate.sweep, [&] {
                  return AuditGates(config, references, gate, kFreshSeeds, kFirstFreshSeed);
                }));
  const std::string text = AuditMarkdown(audits);
  TSDFPP_RETURN_IF_ERROR(WriteFile(gate.sweep.out / "audit.md", text));
  return CommandResult{AuditJson(audits), text};
}

// Not beside those of a report, which may be of another run.
constexpr const char* kExplainedPictures = "explained";

Expected<CommandResult> Explain(const GateRun& run, const References& references,
                                const std::filesystem::path& out) {
  const GateOutcome& outcome = run.gates.front();
  TSDFPP_ASSIGN(const GateExplanation explanation,
                ExplainGate(run, outcome, references, out / kExplainedPictures));
  // Where nothing could be judged the sentence has it.
  const std::string why = outcome.judgement.why.empty() || outcome.judgement.values.empty()
                              ? ""
                              : fmt::format("value: {}\n", outcome.judgement.why);
  return CommandResult{{{"gate", outcome.gate.name},
                        {"verdict", VerdictName(outcome.judgement.verdict)},
                        {"why", outcome.judgement.why},
                        {"bounds_because", outcome.gate.why},
                        {"replicate", explanation.replicate},
                        {"frame", explanation.frame},
                        {"object", explanation.object},
                        {"picture", explanation.picture}},
                       fmt::format("{}\n{}bounds: {} ({})\n", explanation.sentence, why,
                                   outcome.gate.bounds.Text(), outcome.gate.why)};
}

// The reports, with a picture for each gate that does not hold.
Expected<CommandResult> Report(const GateRun& run, const References& references,
                               const std::filesystem::path& out) {
  TSDFPP_RETURN_IF_ERROR(RemoveGateReport(out));
  GateExplanations explanations;
  for (const GateOutcome& outcome : run.gates) {
    if (outcome.passed()) continue;
    TSDFPP_ASSIGN(explanations[outcome.gate.name],
                  ExplainGate(run, outcome, references, out / kGatePictures));
  }
  TSDFPP_RETURN_IF_ERROR(WriteGateReports(run, explanations, out));
  return CommandResult{GateJson(run, explanations), GateTable(run, WantsColour()), run.exit_code()};
}

Expected<CommandResult> RunGateCommand(const GateArguments& options) {
  TSDFPP_RETURN_IF_ERROR(Check(options));
  TSDFPP_ASSIGN(const GatesConfig config, GatesConfig::Load(options.gates));
  TSDFPP_ASSIGN(const References references, LoadReferences(config.references));
  GateOptions gate;
  gate.profile = options.profile;
  gate.sabotages = options.sabotages;
  const auto sabotage = SabotageFromName(options.sabotage);
  if (!sabotage) return UsageError("--sabotage {}", sabotage.error().message);
  gate.sabotage = *sabotage;
  gate.sweep.out =
      options.out.empty() ? std::filesystem::path("out/gates") : std::filesystem::path(options.out);
  gate.sweep.jobs = JobsOrCores(options.jobs);
  if (options.audit) return Audit(config, references, gate);
  if (!options.explain.empty()) {
    if (config.FindGate(options.explain) == nullptr) {
      return UsageError("--explain '{}' is no gate of {}", options.explain, options.gates);
    }
    gate.only = options.explain;
  }
  TSDFPP_ASSIGN(const GateRun run, WithSweepBar("gate", gate.sweep, [&] {
                  return RunGates(config, references, gate);
                }));
  if (options.update) return Update(options, run, references);
  if (!options.explain.empty()) return Explain(run, references, gate.sweep.out);
  return Report(run, references, gate.sweep.out);
}

}  // namespace

Run AddGate(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<GateArguments>();
  app.add_option("GATES", options->gates, "Gates (.toml, docs/gates.md)")->required();
  app.add_option("--profile", options->profile, "quick or full")->check(OneOf({"quick", "full"}));
  app.add_option("--sabotage", options->sabotage,
                 "Break one thing on purpose, in all but the controls (docs/gates.md names them)");
  app.add_flag("--sabotages", options->sabotages,
               "Break each thing in turn and see that the gates meant for it fail");
  app.add_flag("--audit", options->audit,
               "Print the smallest regression that each gate detects, and how often it is wrong on "
               "20 fresh seeds");
  app.add_option("--explain", options->explain,
                 "Name the frame and the object behind this gate's verdict, and draw them");
  app.add_flag("--update", options->update,
               "Show what differs from the references, then write them anew; needs --reason");
  app.add_option("--reason", options->reason, "Why the references change");
  app.add_option("--out", options->out,
                 "Folder of the results; what it has is not run again. By default out/gates")
      ->check(NotEmpty("a folder"));
  app.add_option("--jobs", options->jobs, "Processes; one a core by default")
      ->check(WholeBetween(1, 256));
  return [options] { return RunGateCommand(*options); };
}

}  // namespace tsdfpp
