#include "eval/adapters/adapter.h"

#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "core/plain_name.h"
#include "core/toml_reader.h"
#include "eval/adapters/capped_log.h"
#include "eval/run/compare_names.h"
#include "sequence/cofusion_writer.h"
#include "sequence/export.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMeshes = "meshes";
constexpr const char* kTrajectories = "trajectories";
constexpr const char* kTiming = "timing.json";
constexpr const char* kLog = "log.txt";

// Where the running program is.
fs::path ProgramFolder() {
  std::error_code failure;
  return fs::read_symlink("/proc/self/exe", failure).parent_path();
}

// The frames as a mapper sees them.
class MapperView : public FrameSource {
 public:
  MapperView(FrameSource& source, int last) : source_(source), info_(source.info()) {
    info_.frame_count = last - info_.first_index + 1;
    info_.reveal.reset();
  }
  const SequenceInfo& info() const override { return info_; }
  Expected<Frame> Read(int index) override { return source_.Read(index); }
  bool HasTruth() const override { return false; }
  Expected<std::vector<TrueModel>> Truth() override { return std::vector<TrueModel>{}; }

 private:
  FrameSource& source_;
  SequenceInfo info_;
};

const char* KindOf(const fs::file_status& status) {
  switch (status.type()) {
    case fs::file_type::symlink:
      return "a link";
    case fs::file_type::fifo:
      return "a pipe";
    case fs::file_type::socket:
      return "a socket";
    case fs::file_type::block:
    case fs::file_type::character:
      return "a device";
    default:
      return "no file";
  }
}

// Removes from an adapter's folder what is neither a file nor a folder or has a name that cannot be
// printed. Returns a sentence about the first such thing where its results should be; others become
// remarks.
std::string TidyOutput(AdapterRun& run) {
  const fs::path& out = run.folder;
  std::error_code failure;
  std::vector<std::pair<fs::path, std::string>> odd;
  if (!fs::is_directory(fs::symlink_status(out, failure))) {
    fs::remove(out, failure);
    fs::create_directory(out, failure);
    return run.shown.string() + " is no folder any more, expected the one that it was given";
  }
  fs::permissions(out, fs::perms::owner_all, fs::perm_options::add, failure);
  for (fs::recursive_directory_iterator entry(out, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    std::error_code unknown;
    const fs::file_status status = entry->symlink_status(unknown);
    if (!IsShowable(entry->path().filename().string())) {
      odd.emplace_back(entry->path(), "has a name that cannot be printed");
      entry.disable_recursion_pending();
    } else if (fs::is_directory(status)) {
      // One that cannot be entered could not be removed later either.
      fs::permissions(entry->path(), fs::perms::owner_all, fs::perm_options::add, unknown);
    } else if (!fs::is_regular_file(status)) {
      odd.emplace_back(entry->path(), fmt::format("is {}, expected a file", KindOf(status)));
    }
  }
  std::string first;
  if (failure) {
    first = fmt::format("{} cannot be read ({})", run.shown.string(), failure.message());
  }
  std::sort(odd.begin(), odd.end());
  std::size_t others = 0;
  for (const auto& [path, what] : odd) {
    const fs::path place = path.lexically_relative(out);
    const std::string top = place.begin()->string();
    const bool result = top == kMeshes || top == kTrajectories || top == kTiming;
    if (result && first.empty()) {
      first = fmt::format("{} {}", OneLine((run.shown / place).string()), what);
    }
    if (!result) ++others;
    fs::remove_all(path, failure);
  }
  if (others > 0) {
    run.remarks.push_back(
        fmt::format("{} links, pipes, devices or files with odd names are removed from {}", others,
                    run.shown.string()));
  }
  return first;
}

std::string Joined(const auto& numbers) { return fmt::format("{}", fmt::join(numbers, ",")); }

}  // namespace

Expected<void> AdapterConfig::Validate() const {
  if (name.empty() || name.find_first_of("/\\ \t\n,") != std::string::npos || name.front() == '.') {
    return UsageError("name is {}, expected a word without blanks, commas and slashes",
                      Quoted(name));
  }
  // Its files go to a folder of this name among the comparison's own.
  if (const auto named = CheckPlainName(name, "name"); !named) {
    return UsageError("{}", named.error().message);
  }
  if (IsCompareName(name)) {
    return UsageError("name is {}, which tsdfpp compare gives to a file or folder of its own",
                      Quoted(name));
  }
  if (command.empty()) return UsageError("command is empty, expected a program and its arguments");
  if (layout != DatasetFormat::kCofusion && layout != DatasetFormat::kTum &&
      layout != DatasetFormat::kKlg && layout != DatasetFormat::kSevenScenes) {
    return UsageError("layout is {}, expected cofusion, tum, klg or 7scenes",
                      DatasetFormatName(layout));
  }
  const auto above_zero = [](double value) { return value > 0 && std::isfinite(value); };
  if (!above_zero(time_limit_s))
    return UsageError("time_limit_s is {}, expected above 0", time_limit_s);
  if (!above_zero(memory_limit_mb)) {
    return UsageError("memory_limit_mb is {}, expected above 0", memory_limit_mb);
  }
  constexpr int kMostProcesses = 30'000;
  if (process_limit < 1 || process_limit > kMostProcesses) {
    return UsageError("process_limit is {}, expected 1 to {}", process_limit, kMostProcesses);
  }
  // Some of the output is kept in memory, and sizes are counted in 64 bits.
  constexpr double kMostLog_mb = 1000;
  if (!above_zero(log_limit_mb) || log_limit_mb > kMostLog_mb) {
    return UsageError("log_limit_mb is {}, expected above 0 and at most {}", log_limit_mb,
                      kMostLog_mb);
  }
  constexpr double kMost_mb = 1e12;
  if (!above_zero(disk_limit_mb) || disk_limit_mb > kMost_mb || memory_limit_mb > kMost_mb) {
    return UsageError(
        "disk_limit_mb is {} and memory_limit_mb is {}, expected above 0 and at most "
        "{}",
        disk_limit_mb, memory_limit_mb, kMost_mb);
  }
  if (!above_zero(scale)) return UsageError("scale is {}, expected above 0", scale);
  return {};
}

std::string AdapterConfig::ToToml() const {
  toml::array words;
  for (const std::string& word : command) words.push_back(word);
  const toml::table table{{"name", name},
                          {"command", words},
                          {"layout", DatasetFormatName(layout)},
                          {"time_limit_s", time_limit_s},
                          {"memory_limit_mb", memory_limit_mb},
                          {"process_limit", process_limit},
                          {"log_limit_mb", log_limit_mb},
                          {"disk_limit_mb", disk_limit_mb},
                          {"scale", scale},
                          {"match", match == MatchMode::kNames ? "names" : "overlap"}};
  return TomlText(table) + "\n";
}

Expected<AdapterConfig> ReadAdapter(const fs::path& file) {
  TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(file));
  AdapterConfig config;
  std::string layout = DatasetFormatName(config.layout);
  std::string match = "names";
  TomlReader reader(table, file.string());
  reader.Get("name", config.name, true)
      .Get("command", config.command, true)
      .Get("layout", layout)
      .Get("time_limit_s", config.time_limit_s)
      .Get("memory_limit_mb", config.memory_limit_mb)
      .Get("process_limit", config.process_limit)
      .Get("log_limit_mb", config.log_limit_mb)
      .Get("disk_limit_mb", config.disk_limit_mb)
      .Get("scale", config.scale)
      .Get("match", match);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  const auto format = DatasetFormatFromName(layout);
  if (!format) return UsageError("{}: layout: {}", file.string(), format.error().message);
  config.layout = *format;
  const auto mode = MatchModeFromName(match);
  if (!mode) {
    return UsageError("{}: match is '{}', expected names or overlap", file.string(), match);
  }
  config.match = *mode;
  config.folder = AbsolutePath(file).parent_path();
  const auto valid = config.Validate();
  if (!valid) return UsageError("{}: {}", file.string(), valid.error().message);
  return config;
}

std::vector<std::string> AdapterNames() {
  std::vector<std::string> names;
  std::error_code failure;
  for (fs::directory_iterator entry(ProgramFolder() / "adapters", failure), end;
       !failure && entry != end; entry.increment(failure)) {
    if (entry->path().extension() == ".toml") names.push_back(entry->path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

Expected<AdapterConfig> FindAdapter(const std::string& name) {
  const std::vector<std::string> names = AdapterNames();
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    return UsageError("adapter '{}' is unknown, there are: {}", name, fmt::join(names, ", "));
  }
  return ReadAdapter(ProgramFolder() / "adapters" / (name + ".toml"));
}

Expected<std::vector<std::string>> CommandOf(const AdapterConfig& config, const AdapterTask& task,
                                             const fs::path& out) {
  const std::map<std::string, std::string> words{
      {"sequence", AbsolutePath(task.sequence).string()},
      {"out", AbsolutePath(out).string()},
      {"adapter", config.folder.string()},
      {"programs", ProgramFolder().string()},
      {"first", fmt::format("{}", task.first_frame)},
      {"last", fmt::format("{}", task.last_frame)},
      {"frames", Joined(task.frames)},
      {"removed", Joined(task.removed)},
      {"voxel", fmt::format("{}", task.voxel_m)},
      {"truncation", fmt::format("{}", task.truncation_m)},
      {"truncation_back", fmt::format("{}", task.truncation_back_m)}};
  std::vector<std::string> command;
  for (const std::string& given : config.command) {
    std::string word;
    for (std::size_t at = 0; at < given.size();) {
      const std::size_t open = given.find('{', at);
      word += given.substr(at, open - at);
      if (open == std::string::npos) break;
      const std::size_t close = given.find('}', open);
      const std::string key = close == std::string::npos ? given.substr(open + 1)
                                                         : given.substr(open + 1, close - open - 1);
      const auto found = words.find(key);
      if (close == std::string::npos || found == words.end()) {
        std::vector<std::string> known;
        known.reserve(words.size());
        for (const auto& [name, value] : words) known.push_back("{" + name + "}");
        return UsageError("{}: command: '{}' has the unknown word '{{{}', expected one of {}",
                          config.name, given, key, fmt::join(known, " "));
      }
      word += found->second;
      at = close + 1;
    }
    command.push_back(std::move(word));
  }
  return command;
}

Expected<void> RunAdapter(AdapterRun& run, const AdapterTask& task, const fs::path& out,
                          const fs::path& shown) {
  TSDFPP_ASSIGN(const std::vector<std::string> command, CommandOf(run.config, task, out));
  std::error_code failure;
  // What an earlier run left would be taken for this one's.
  fs::remove_all(out, failure);
  if (failure) {
    return EnvironmentError("{}: cannot be removed ({})", out.string(), failure.message());
  }
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(out));
  run.folder = out;
  run.shown = shown;
  constexpr double kBytes = 1e6;
  const auto bytes = [](double megabytes) { return static_cast<std::int64_t>(kBytes * megabytes); };
  ChildLimits limits;
  limits.time_s = run.config.time_limit_s;
  limits.memory_bytes = bytes(run.config.memory_limit_mb);
  limits.processes = run.config.process_limit;
  limits.log_bytes = bytes(run.config.log_limit_mb);
  limits.disk_bytes = bytes(run.config.disk_limit_mb);
  run.outcome = RunChildProcess(run.config.name, command, out, AbsolutePath(out / kLog), limits,
                                shown / kLog);
  if (run.outcome.failure) run.Fail(*run.outcome.failure);
  // Also of one that failed: what it left must not be in anybody's way.
  const std::string odd = TidyOutput(run);
  if (run.failure) return {};
  if (!odd.empty()) {
    run.Fail({ErrorKind::kData, fmt::format("{}: {}", run.config.name, odd)});
    return {};
  }
  if (!fs::exists(out / kTiming, failure)) return {};
  const auto text = ReadFile(out / kTiming, &Limits::json_bytes);
  auto timing = text ? ParseJson(*text, (shown / kTiming).string())
                     : Expected<nlohmann::json>(tl::unexpected(text.error()));
  if (timing) {
    run.timing = std::move(*timing);
  } else {
    run.Fail({timing.error().kind, fmt::format("{}: {}", run.config.name, timing.error().message)});
  }
  return {};
}

std::string WithShownFolder(const AdapterRun& run, std::string text) {
  const std::string real = run.folder.string();
  if (real.empty() || run.folder == run.shown) return text;
  const std::string shown = run.shown.string();
  for (std::size_t at = text.find(real); at != std::string::npos;
       at = text.find(real, at + shown.size())) {
    text.replace(at, real.size(), shown);
  }
  return text;
}

void EvaluateAdapter(AdapterRun& run, const SceneTruth& truth, const std::vector<ObjectInfo>& names,
                     const AdapterTask& task) {
  if (run.failure) return;
  EvaluateConfig config;
  config.meshes = run.folder / kMeshes;
  config.frames = task.frames;
  config.removed = task.removed;
  config.scale = run.config.scale;
  config.scale_is_given = run.config.scale != 1;
  config.voxel_m = task.voxel_m;
  config.match = run.config.match;
  auto prepared = PrepareMeshes(truth, names, config);
  if (!prepared) {
    run.Fail({prepared.error().kind, WithShownFolder(run, fmt::format("{}: {}", run.config.name,
                                                                      prepared.error().message))});
    return;
  }
  for (const std::string& found : prepared->remarks) {
    const std::string remark = WithShownFolder(run, found);
    if (std::find(run.remarks.begin(), run.remarks.end(), remark) == run.remarks.end()) {
      run.remarks.push_back(remark);
    }
  }
  if (run.last_seen.empty()) run.last_seen = MakeLastSeenStores(truth);
  run.evaluations.push_back(EvaluateMeshes(std::move(prepared->meshes), truth, names, task.removed,
                                           task.voxel_m, run.last_seen));
  run.matches.push_back(std::move(prepared->matches));
}

Expected<void> WriteForAdapters(FrameSource& source, DatasetFormat layout, int last,
                                const fs::path& out) {
  MapperView view(source, last);
  if (layout == DatasetFormat::kCofusion) {
    return WriteCofusion(view, {TSDFPP_VERSION, std::nullopt, "as given", "", ""}, out);
  }
  TSDFPP_ASSIGN(const ExportReport report, ExportSequence(view, layout, out));
  if (report.frames != view.info().frame_count) {
    return DataError("{}: holds {} frames, expected {}", out.string(), report.frames,
                     view.info().frame_count);
  }
  return {};
}

nlohmann::json ToJson(const AdapterRun& run) {
  nlohmann::json evaluations = nlohmann::json::array();
  for (std::size_t i = 0; i < run.evaluations.size(); ++i) {
    nlohmann::json one = ToJson(run.evaluations[i]);
    one.erase("mesh_s");
    one["matching"] = ToJson(run.matches[i]);
    evaluations.push_back(std::move(one));
  }
  nlohmann::json json{{"name", run.config.name},
                      {"command", run.config.command},
                      {"folder", run.folder.filename().string()},
                      {"wall_s", run.outcome.wall_s},
                      {"cpu_s", run.outcome.cpu_s},
                      {"peak_bytes", run.outcome.peak_bytes},
                      {"timing", run.timing},
                      {"remarks", run.remarks},
                      {"evaluations", evaluations}};
  json["failure"] = run.failure ? nlohmann::json(run.failure->message) : nlohmann::json(nullptr);
  if (run.timing.is_null()) {
    json["timing"] = ToJson(Measured::Undefined("the adapter wrote no timing.json"));
  }
  if (run.trajectories) json["trajectories"] = ToJson(*run.trajectories);
  return json;
}

}  // namespace tsdfpp
