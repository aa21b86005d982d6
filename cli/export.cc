#include "sequence/export.h"

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/sequence_options.h"
#include "cli/stop_on_signal.h"

namespace tsdfpp {

Run AddExport(CLI::App& app, const CommonOptions&) {
  struct Options {
    SequenceArguments source;
    std::string to;
    std::string out;
  };
  auto options = std::make_shared<Options>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source);
  app.add_option("--to", options->to, "Format to write")
      ->check(OneOf({"tum", "bop", "klg", "7scenes"}))
      ->required();
  app.add_option("--out", options->out, "Folder to write: new or empty")
      ->check(NotEmpty("a folder"))
      ->required();
  return [options]() -> Expected<CommandResult> {
    TSDFPP_ASSIGN(const DatasetFormat format, DatasetFormatFromName(options->to));
    TSDFPP_ASSIGN(auto source, OpenArguments(options->source));
    Expected<ExportReport> report;
    {
      const StopOnSignal handler;
      ProgressBar bar("export");
      report = ExportSequence(
          *source, format, options->out, [&](int done, int total) { bar.Show(done, total); },
          &StopOnSignal::stop());
    }
    if (!report && StopOnSignal::stop()) StopOnSignal::Die(report.error());
    if (!report) return tl::unexpected(report.error());
    std::string text =
        fmt::format("{}: {} frames of {} as {}; depth is within {:g} mm\n", options->out,
                    report->frames, source->info().name, options->to, 1000 * report->depth_bound_m);
    for (const std::string& left_out : report->left_out) {
      text += fmt::format("not kept: {}\n", left_out);
    }
    return CommandResult{{{"sequence", source->info().name},
                          {"format", options->to},
                          {"out", options->out},
                          {"frames", report->frames},
                          {"depth_bound_m", report->depth_bound_m},
                          {"not_kept", report->left_out}},
                         text};
  };
}

}  // namespace tsdfpp
