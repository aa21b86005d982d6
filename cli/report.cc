#include "cli/report.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <vector>

#include "core/files.h"
#include "core/folders.h"
#include "eval/report/report_page.h"
#include "eval/report/report_video.h"
#include "eval/run/run_folder.h"

namespace tsdfpp {
namespace {

struct ReportArguments {
  std::string run;
  std::string compare;
  std::string gates;
  std::string out;
  bool video = false;
};

// What is read must not be written over: the page would take its place.
Expected<void> CheckOut(const std::filesystem::path& out,
                        const std::vector<std::filesystem::path>& folders,
                        const std::filesystem::path& gates) {
  const std::filesystem::path place = TruePath(out);
  const auto is = [&](const std::filesystem::path& file) { return TruePath(file) == place; };
  const auto wrong = [&] {
    return UsageError("--out '{}' is a file that the page is made of, expected another",
                      out.string());
  };
  if (!gates.empty() && is(gates)) return wrong();
  for (const std::filesystem::path& folder : folders) {
    if (is(folder / kRunNote)) return wrong();
    const auto note = ReadRunNote(folder);
    if (!note || !*note) continue;  // which is said where the run is read
    for (const auto& [name, bytes] : (*note)->files) {
      // Without a size it is there to be made anew.
      if (bytes && is(folder / name)) return wrong();
    }
  }
  return {};
}

Expected<CommandResult> RunVideo(const ReportArguments& options) {
  const std::filesystem::path out = options.out.empty()
                                        ? std::filesystem::path(options.run) / "report.mp4"
                                        : std::filesystem::path(options.out);
  if (!options.compare.empty() || !options.gates.empty()) {
    return UsageError("{} is for the page, expected it without --video",
                      options.compare.empty() ? "--gates" : "--compare");
  }
  TSDFPP_RETURN_IF_ERROR(CheckOut(out, {options.run}, {}));
  TSDFPP_ASSIGN(const ReportVideo video, WriteReportVideo(options.run, out));
  return CommandResult{{{"video", out.string()},
                        {"frames", video.frames},
                        {"width", video.width},
                        {"height", video.height},
                        {"seconds", video.seconds}},
                       fmt::format("video: {} ({:.0f} s, {} x {})\n", out.string(), video.seconds,
                                   video.width, video.height)};
}

Expected<CommandResult> RunReport(const ReportArguments& options) {
  if (options.video) return RunVideo(options);
  std::vector<std::filesystem::path> folders{options.run};
  std::string command = "tsdfpp report " + options.run;
  if (!options.compare.empty()) {
    folders.emplace_back(options.compare);
    command += " --compare " + options.compare;
  }
  // Verdicts that lie beside the comparison belong to it.
  std::filesystem::path gates = std::filesystem::path(options.run) / "gates.json";
  if (!options.gates.empty()) {
    gates = options.gates;
    command += " --gates " + options.gates;
  } else if (std::error_code none; !std::filesystem::exists(gates, none)) {
    gates.clear();
  }
  const std::filesystem::path out = options.out.empty()
                                        ? std::filesystem::path(options.run) / "report.html"
                                        : std::filesystem::path(options.out);
  if (!options.out.empty()) command += " --out " + options.out;
  TSDFPP_RETURN_IF_ERROR(CheckOut(out, folders, gates));
  TSDFPP_ASSIGN(const ReportPage page, MakeReportPage(folders, command, kLargestPage_bytes, gates));
  TSDFPP_RETURN_IF_ERROR(WriteFile(out, page.html));
  for (const std::string& remark : page.remarks) spdlog::warn("{}", remark);
  return CommandResult{
      {{"report", out.string()}, {"bytes", page.html.size()}, {"remarks", page.remarks}},
      fmt::format("report: {} ({:.1f} MB)\n", out.string(),
                  static_cast<double>(page.html.size()) / 1e6)};
}

}  // namespace

Run AddReport(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<ReportArguments>();
  app.add_option("RUN", options->run, "Folder that tsdfpp compare wrote")
      ->check(NotEmpty("a folder"))
      ->required();
  app.add_option("--compare", options->compare, "A second such folder, to set against the first")
      ->check(NotEmpty("a folder"));
  app.add_option("--gates", options->gates,
                 "The verdicts to show: a gates.json that tsdfpp gate wrote; RUN/gates.json where "
                 "that is there")
      ->check(NotEmpty("a file"));
  app.add_option("--out", options->out, "The file; RUN/report.html or RUN/report.mp4 by default")
      ->check(NotEmpty("a file"));
  app.add_flag("--video", options->video,
               "A film (MP4, H.264) in place of the page: camera, masks, the maps, the removal");
  AddFollowLinks(app);
  return [options] { return RunReport(*options); };
}

}  // namespace tsdfpp
