#include "eval/sweep/bench_set.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <thread>

#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "eval/sweep/sweep_metrics.h"
#include "sequence/sequence_json.h"
#include "sim/load_scene.h"
#include "sim/motion/scene_motion.h"
#include "sim/scene/scene_builder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// A text of a result in a table's cell: one line, and nothing that Markdown or a browser would read
// as more than text.
std::string InMarkdown(std::string_view text) {
  constexpr std::size_t kMostBytes = 200;
  std::string escaped;
  for (const char c : OneLine(text, kMostBytes)) {
    if (std::string_view("\\|<>[]`*&!").find(c) != std::string_view::npos) escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string Rounded(const Eigen::Vector3d& p) {
  constexpr double kUnits_per_m = 1e5;
  return fmt::format("{} {} {}\n", std::llround(p.x() * kUnits_per_m),
                     std::llround(p.y() * kUnits_per_m), std::llround(p.z() * kUnits_per_m));
}

// Where a pose takes the origin and the ends of the axes, each 10 cm long.
std::string Rounded(const Pose& T) {
  constexpr double kArm_m = 0.1;
  std::string text = Rounded(Eigen::Vector3d(T.translation()));
  for (int axis = 0; axis < 3; ++axis) {
    text += Rounded(Eigen::Vector3d(T.translation() + kArm_m * T.linear().col(axis)));
  }
  return text;
}

Expected<BenchSequence> ReadSequence(const toml::table& table, const std::string& where) {
  BenchSequence sequence;
  TomlReader reader(table, where, "sequence");
  reader.Get("name", sequence.name, true)
      .Get("scene", sequence.scene, true)
      .Get("scene_hash", sequence.scene_hash, true)
      .Get("truth_hash", sequence.truth_hash, true);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return sequence;
}

std::string FirstLineWith(const char* file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t at = line.find_first_not_of(" \t", line.find(':') + 1);
    return at == std::string::npos ? "" : line.substr(at);
  }
  return "unknown";
}

json HardwareJson() {
  utsname system{};
  uname(&system);
  const double pages = static_cast<double>(sysconf(_SC_PHYS_PAGES));
  const double page_bytes = static_cast<double>(sysconf(_SC_PAGESIZE));
  return {{"cpu", FirstLineWith("/proc/cpuinfo", "model name")},
          {"cores", std::thread::hardware_concurrency()},
          {"memory_gb", std::round(pages * page_bytes / 1e9)},
          {"gpu", "none used"},
          {"system", fmt::format("{} {} {}", system.sysname, system.release, system.machine)}};
}

std::string Text(const Measured& value, int decimals) {
  return value.value ? fmt::format("{:.{}f}", *value.value, decimals) : "-";
}

}  // namespace

Expected<BenchSet> BenchSet::Load(const fs::path& folder, const std::string& name) {
  BenchSet set;
  set.file = folder / name / "set.toml";
  std::error_code code;
  if (!fs::exists(set.file, code)) {
    std::string known;
    for (const fs::path& entry : EntriesOf(folder)) {
      if (!IsThere(entry / "set.toml")) continue;
      known += (known.empty() ? "" : ", ") + entry.filename().string();
    }
    return UsageError("there is no benchmark '{}' in {}, expected one of: {}", name,
                      folder.string(), known.empty() ? "none is there" : known);
  }
  TSDFPP_ASSIGN(const std::string text, ReadFile(set.file));
  set.hash = HashText(text);
  const std::string where = set.file.string();
  TSDFPP_ASSIGN(const toml::table root, ParseToml(text, where));
  TomlReader reader(root, where);
  reader.Get("name", set.name, true)
      .Get("scale", set.scale, true)
      .Get("voxel_m", set.voxel_m, true)
      .Get("trunc_front", set.trunc_front, true)
      .Get("trunc_back", set.trunc_back, true)
      .Get("metrics", set.metrics, true);
  for (const std::string& metric : set.metrics) {
    if (FindMetric(metric) == nullptr) {
      reader.Fault("metrics", fmt::format("holds '{}', which is no metric", metric));
    }
  }
  if (set.metrics.empty()) reader.Fault("metrics", "is empty, expected one name at least");
  for (const toml::table* table : reader.Tables("sequence", true)) {
    TSDFPP_ASSIGN(BenchSequence sequence, ReadSequence(*table, where));
    set.sequences.push_back(std::move(sequence));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return set;
}

Expected<BenchSequence> HashSequence(const BenchSet& set, const BenchSequence& sequence) {
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(set.file.parent_path() / sequence.scene));
  TSDFPP_ASSIGN(CompiledScene compiled, CompiledScene::Compile(scene));
  TSDFPP_ASSIGN(const SceneMotion motion, SceneMotion::Make(scene));
  std::string truth;
  for (const TrueModel& model : compiled.TrueModels()) {
    truth += fmt::format("{} {}\n", model.info.id, model.info.name);
    for (const Eigen::Vector3f& vertex : model.mesh_O.vertices) {
      truth += Rounded(Eigen::Vector3d(vertex.cast<double>()));
    }
  }
  for (int frame = kFirstFrame; frame < kFirstFrame + scene.frames; ++frame) {
    truth += Rounded(motion.T_WC(frame));
    for (const auto& [id, T_WO] : motion.T_WO(frame)) {
      truth += fmt::format("{} {}", id, Rounded(T_WO));
    }
  }
  return BenchSequence{sequence.name, sequence.scene, HashText(SceneToToml(scene)),
                       HashText(truth)};
}

Expected<void> CheckFrozen(const BenchSet& set) {
  for (const BenchSequence& sequence : set.sequences) {
    TSDFPP_ASSIGN(const BenchSequence now, HashSequence(set, sequence));
    if (now.scene_hash != sequence.scene_hash) {
      return DataError("benchmark {}: scene of sequence {} has hash {}, frozen is {}", set.name,
                       sequence.name, now.scene_hash, sequence.scene_hash);
    }
    if (now.truth_hash != sequence.truth_hash) {
      return DataError(
          "benchmark {}: surfaces and motion of sequence {} have hash {}, frozen is {}", set.name,
          sequence.name, now.truth_hash, sequence.truth_hash);
    }
  }
  return {};
}

Expected<ExperimentConfig> ExperimentOf(const BenchSet& set,
                                        const std::vector<std::string>& methods) {
  ExperimentConfig config;
  config.file = set.file;
  config.name = "bench-set-" + set.name;
  config.question = "What does the benchmark say?";
  config.metrics = set.metrics;
  config.frames.scale = set.scale;
  std::vector<AxisValue> names;
  for (const std::string& method : methods) {
    CellSettings probe;
    if (auto known = FindAxis("method")->set(probe, method); !known) {
      return tl::unexpected(known.error());
    }
    names.emplace_back(probe.method);
  }
  if (names.empty()) return UsageError("no method is named, expected one at least");
  config.baseline = std::get<std::string>(names.front());
  for (const BenchSequence& sequence : set.sequences) {
    config.grids.push_back({sequence.name,
                            {{"scene", {sequence.scene}},
                             {"method", names},
                             {"voxel_m", {set.voxel_m}},
                             {"trunc_front", {set.trunc_front}},
                             {"trunc_back", {set.trunc_back}}}});
  }
  return config;
}

json BenchResultJson(const BenchSet& set, const SweepResult& result, const std::string& method,
                     const std::string& commit) {
  json entries = json::array();
  for (const SweepResult::Entry& entry : result.entries) {
    if (entry.cell.settings.method != method) continue;
    json scores;
    for (const std::string& name : set.metrics) {
      for (std::size_t m = 0; m < SweepMetrics().size(); ++m) {
        if (SweepMetrics()[m].name == name) scores[name] = ToJson(entry.result.examined[m]);
      }
    }
    entries.push_back({{"sequence", entry.grid}, {"scores", scores}});
  }
  return {{"schema", kBenchResultSchema},
          {"kind", "tsdfpp bench result"},
          {"bench_set", set.name},
          {"bench_hash", set.hash},
          {"method", {{"name", method}, {"version", result.program}, {"commit", commit}}},
          {"hardware", HardwareJson()},
          {"renderer", result.renderer},
          {"entries", entries}};
}

Expected<BenchResult> ReadBenchResult(const BenchSet& set, const fs::path& file) {
  const std::string where = file.string();
  TSDFPP_ASSIGN(const json root, ReadJsonObject(file));
  if (root.value("kind", json()) != "tsdfpp bench result" ||
      root.value("schema", json()) != kBenchResultSchema) {
    return DataError("{}: is no benchmark result of schema {}", where, kBenchResultSchema);
  }
  if (root.value("bench_set", json()) != set.name || root.value("bench_hash", json()) != set.hash) {
    return DataError("{}: is of benchmark {} with hash {}, expected {} with {}", where,
                     JsonShown(root.value("bench_set", json())),
                     JsonShown(root.value("bench_hash", json())), set.name, set.hash);
  }
  BenchResult result;
  result.file = file.filename().string();
  try {
    result.method = root.at("method").at("name");
    result.version = root.at("method").at("version");
    result.commit = root.at("method").at("commit");
    const json& hardware = root.at("hardware");
    result.hardware =
        fmt::format("{}, {} cores, {} GB, GPU: {}", hardware.at("cpu").get<std::string>(),
                    hardware.at("cores").get<double>(), hardware.at("memory_gb").get<double>(),
                    hardware.at("gpu").get<std::string>());
    for (const json& entry : root.at("entries")) {
      auto& scores = result.scores[entry.at("sequence").get<std::string>()];
      if (!scores.empty()) {
        return DataError("{}: sequence {} is there twice", where, JsonShown(entry.at("sequence")));
      }
      for (const auto& [name, value] : entry.at("scores").items()) {
        scores[name] = value.is_number() ? Measured::Of(value.get<double>())
                                         : Measured::Undefined(value.at("why"));
        if (!value.is_number() && !value.at("value").is_null()) {
          return DataError("{}: {} is neither a number nor null with a reason", where,
                           OneLine(name));
        }
        const SweepMetric* metric = FindMetric(name);
        constexpr double kNoEnd = std::numeric_limits<double>::infinity();
        const double most = metric == nullptr ? kNoEnd : MostOf(*metric).value_or(kNoEnd);
        const double score = scores[name].value.value_or(0);
        if (score < 0 || score > most) {
          return DataError("{}: {} of sequence {} is {}, expected {}", where, OneLine(name),
                           JsonShown(entry.at("sequence")), JsonShown(value),
                           most < kNoEnd ? fmt::format("0 to {}", most) : "0 or more");
        }
      }
    }
  } catch (const json::exception& error) {
    return DataError("{}: a field is missing or wrong ({})", where, WithoutTag(error.what()));
  }
  for (const BenchSequence& sequence : set.sequences) {
    const auto scores = result.scores.find(sequence.name);
    if (scores == result.scores.end()) {
      return DataError("{}: sequence {} is missing", where, sequence.name);
    }
    for (const std::string& metric : set.metrics) {
      if (!scores->second.contains(metric)) {
        return DataError("{}: metric {} of sequence {} is missing", where, metric, sequence.name);
      }
    }
    if (scores->second.size() != set.metrics.size()) {
      return DataError("{}: sequence {} has {} metrics, the benchmark {}", where, sequence.name,
                       scores->second.size(), set.metrics.size());
    }
  }
  if (result.scores.size() != set.sequences.size()) {
    return DataError("{}: has {} sequences, the benchmark {}", where, result.scores.size(),
                     set.sequences.size());
  }
  return result;
}

Expected<std::string> Leaderboard(const BenchSet& set, const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::path& entry : EntriesOf(folder)) {
    if (entry.extension() == ".json") files.push_back(entry);
  }
  if (files.empty()) {
    return UsageError("{}: holds no result, expected a folder of *.json", folder.string());
  }
  std::sort(files.begin(), files.end());
  struct Row {
    BenchResult result;
    std::vector<Measured> means;
    std::vector<MeasuredInterval> intervals;
  };
  std::vector<Row> rows;
  for (const fs::path& file : files) {
    Row row;
    TSDFPP_ASSIGN(row.result, ReadBenchResult(set, file));
    for (const std::string& metric : set.metrics) {
      std::vector<double> values;
      for (const auto& [sequence, scores] : row.result.scores) {
        if (scores.at(metric).value) values.push_back(*scores.at(metric).value);
      }
      row.means.push_back(values.empty() ? Measured::Undefined("undefined in every sequence")
                                         : Measured::Of(MeanOf(values)));
      row.intervals.push_back(
          BootstrapInterval(values, MeanOf, {BootstrapConfig::Method::kPercentile}));
    }
    rows.push_back(std::move(row));
  }
  const bool higher = FindMetric(set.metrics.front())->better == Better::kHigher;
  std::stable_sort(rows.begin(), rows.end(), [&](const Row& a, const Row& b) {
    const Measured& x = a.means.front();
    const Measured& y = b.means.front();
    if (!x.value || !y.value) return x.value.has_value() && !y.value;
    return higher ? *x.value > *y.value : *x.value < *y.value;
  });

  std::string page = fmt::format(
      "# Benchmark {}\n\n{} sequences, images of {} times the scenes' size, voxels of {} m, "
      "truncation {} voxels in front and {} behind; set file hash {}. Means over the sequences, "
      "with 95 % bootstrap intervals; `-` is undefined.\n\n| method |",
      set.name, set.sequences.size(), set.scale, set.voxel_m, set.trunc_front, set.trunc_back,
      set.hash);
  std::string rule = "\n| --- |";
  for (const std::string& metric : set.metrics) {
    const SweepMetric& words = *FindMetric(metric);
    page += fmt::format(" {}{} |", words.words,
                        words.unit.empty() ? "" : fmt::format(", {}", words.unit));
    rule += " --- |";
  }
  page += fmt::format(" version | commit | hardware |{} --- | --- | --- |\n", rule);
  for (const Row& row : rows) {
    page += fmt::format("| {} |", InMarkdown(row.result.method));
    for (std::size_t m = 0; m < set.metrics.size(); ++m) {
      const int decimals = FindMetric(set.metrics[m])->decimals;
      page += fmt::format(" {}", Text(row.means[m], decimals));
      if (const auto& interval = row.intervals[m].value) {
        page +=
            fmt::format(" [{:.{}f}, {:.{}f}]", interval->low, decimals, interval->high, decimals);
      }
      page += " |";
    }
    page += fmt::format(" {} | {} | {} |\n", InMarkdown(row.result.version),
                        InMarkdown(row.result.commit), InMarkdown(row.result.hardware));
  }
  for (const std::string& metric : set.metrics) {
    const SweepMetric& words = *FindMetric(metric);
    page += fmt::format("\n## {}\n\n| method |", words.words);
    rule = "\n| --- |";
    for (const BenchSequence& sequence : set.sequences) {
      page += fmt::format(" {} |", sequence.name);
      rule += " --- |";
    }
    page += rule + "\n";
    for (const Row& row : rows) {
      page += fmt::format("| {} |", InMarkdown(row.result.method));
      for (const BenchSequence& sequence : set.sequences) {
        page += fmt::format(" {} |",
                            Text(row.result.scores.at(sequence.name).at(metric), words.decimals));
      }
      page += "\n";
    }
  }
  return page;
}

}  // namespace tsdfpp
