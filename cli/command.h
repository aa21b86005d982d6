// What the subcommands of `tsdfpp` share.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// Options that every subcommand has, and one that those have which map.
struct CommonOptions {
  bool json = false;             // the result as JSON on stdout; the log goes to stderr always
  int threads = 0;               // 0 is all cores
  std::string kernels = "simd";  // of the mapper: a name of mapper/kernels.h
};

// A subcommand's result: what --json prints, and the text printed without it.
struct CommandResult {
  nlohmann::json json;
  std::string text;
  int exit_code = 0;  // of a command that ran but whose verdict is not good
  // A sentence for standard error, of a command that did a part of its work.
  std::string complaint = {};
};

// Registers the subcommand's options on `app`; returns what to run once they are parsed.
using Run = std::function<Expected<CommandResult>()>;
Run AddDoctor(CLI::App& app, const CommonOptions& common);
Run AddGenerate(CLI::App& app, const CommonOptions& common);
Run AddVerify(CLI::App& app, const CommonOptions& common);
Run AddExport(CLI::App& app, const CommonOptions& common);
Run AddGate(CLI::App& app, const CommonOptions& common);
Run AddMap(CLI::App& app, const CommonOptions& common);
Run AddMethods(CLI::App& app, const CommonOptions& common);
Run AddCompare(CLI::App& app, const CommonOptions& common);
Run AddEvaluate(CLI::App& app, const CommonOptions& common);
Run AddMetric(CLI::App& app, const CommonOptions& common);
Run AddBenchSet(CLI::App& app, const CommonOptions& common);
Run AddReplay(CLI::App& app, const CommonOptions& common);
Run AddSweep(CLI::App& app, const CommonOptions& common);

// A progress bar on stderr, with frames a second and the time left, where that is a terminal;
// silent elsewhere.
class ProgressBar {
 public:
  explicit ProgressBar(std::string title);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  // `before` of the frames `done` were there when the bar began: they do not count for the speed.
  void Show(int done, int total, int before = 0);

 private:
  std::string title_;
  bool terminal_;
  bool shown_ = false;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// "14.2 frames/s, 1:05 left" once `done` of `total` frames took `elapsed_s`; empty while nothing
// can be said.
std::string SpeedText(int done, int total, double elapsed_s);

// What a number has to be, for add_option(...)->check().
CLI::Validator AboveZero();
CLI::Validator NotNegative();
CLI::Validator Between(double low, double high);
CLI::Validator WholeBetween(std::int64_t low, std::int64_t high);
// What a word has to be; `expected` is a phrase, e.g. "a folder".
CLI::Validator OneOf(const std::vector<std::string>& words);
CLI::Validator NotEmpty(const std::string& expected);

// The flag --follow-links, for subcommands that read data with paths in it or folders of data.
void AddFollowLinks(CLI::App& app);

// A subcommand as it was typed: its name and what was given, as run.json notes it.
std::string CommandText(const CLI::App& app);

// The words between commas. Empty text gives none.
std::vector<std::string> SplitList(const std::string& text);

// The same of an option that names objects. Errors: kUsage where there is text and no word in it.
Expected<std::vector<std::string>> NamesOf(const std::string& option, const std::string& text);

}  // namespace tsdfpp
