#include "eval/sweep/bench_result.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <thread>

#include "core/folders.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kKind = "tsdfpp bench result";

// More than any scene or machine can give, and so little that sums of them have an end.
constexpr double kMostOfAny = 1e15;

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

// Is it a result of this benchmark? Errors: kData.
Expected<void> CheckHead(const json& root, const BenchSet& set, const std::string& where) {
  if (root.value("kind", json()) != kKind || root.value("schema", json()) != kBenchResultSchema) {
    return DataError("{}: is no benchmark result of schema {}", where, kBenchResultSchema);
  }
  if (root.value("bench_set", json()) != set.name || root.value("bench_hash", json()) != set.hash) {
    return DataError("{}: is of benchmark {} with hash {}, expected {} with {}", where,
                     JsonShown(root.value("bench_set", json())),
                     JsonShown(root.value("bench_hash", json())), set.name, set.hash);
  }
  return {};
}

// Throws json::exception, as the next ones do, where a field is missing or of another type.
std::string HardwareText(const json& hardware) {
  return fmt::format("{}, {} cores, {} GB, GPU: {}", hardware.at("cpu").get<std::string>(),
                     hardware.at("cores").get<double>(), hardware.at("memory_gb").get<double>(),
                     hardware.at("gpu").get<std::string>());
}

// A score of the metric `name`, in the range that the metric has where we know it.
Expected<Measured> ReadScore(const std::string& name, const json& value, const json& sequence,
                             const std::string& where) {
  const auto wrong = [&](const std::string& expected) {
    return DataError("{}: {} of sequence {} is {}, expected {}", where, OneLine(name),
                     JsonShown(sequence), JsonShown(value), expected);
  };
  if (value.is_number()) {
    const SweepMetric* metric = FindMetric(name);
    const double most = metric == nullptr ? kMostOfAny : MostOf(*metric).value_or(kMostOfAny);
    const auto number = value.get<double>();
    if (!(number >= 0 && number <= most + kShareRounding)) {
      return wrong(fmt::format("0 to {:g}", most));
    }
    return Measured::Of(number);
  }
  const json why = value.is_object() ? value.value("why", json()) : json();
  if (!why.is_string() || !value.value("value", json(0)).is_null()) {
    return wrong("a number or {\"value\": null, \"why\": \"...\"}");
  }
  return Measured::Undefined(why.get<std::string>());
}

Expected<void> ReadEntry(const json& entry, const std::string& where, BenchResult& result) {
  const auto field = [&](const char* name) {
    return entry.is_object() ? entry.value(name, json()) : json();
  };
  const json sequence = field("sequence");
  const json named = field("scores");
  if (!sequence.is_string() || !named.is_object()) {
    return DataError(
        "{}: an entry is {}, expected an object with the name 'sequence' and the "
        "object 'scores'",
        where, JsonShown(entry));
  }
  const auto [place, is_new] = result.scores.try_emplace(sequence.get<std::string>());
  if (!is_new) return DataError("{}: sequence {} is there twice", where, JsonShown(sequence));
  for (const auto& [name, value] : named.items()) {
    TSDFPP_ASSIGN(place->second[name], ReadScore(name, value, sequence, where));
  }
  return {};
}

// Has it each sequence and metric of the benchmark, and no others? Errors: kData.
Expected<void> CheckComplete(const BenchResult& result, const BenchSet& set,
                             const std::string& where) {
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
  return {};
}

// A result with what the leaderboard shows of it, by metric of the set.
struct LeaderboardRow {
  BenchResult result;
  std::vector<Measured> means;       // over the sequences where it is defined
  std::vector<std::size_t> defined;  // those
  std::vector<MeasuredInterval> intervals;
};

LeaderboardRow RowOf(BenchResult result, const BenchSet& set) {
  LeaderboardRow row;
  for (const std::string& metric : set.metrics) {
    std::vector<double> values;
    for (const auto& [sequence, scores] : result.scores) {
      if (scores.at(metric).value) values.push_back(*scores.at(metric).value);
    }
    row.defined.push_back(values.size());
    row.means.push_back(values.empty() ? Measured::Undefined("undefined in every sequence")
                                       : Measured::Of(MeanOf(values)));
    row.intervals.push_back(
        BootstrapInterval(values, MeanOf, {BootstrapConfig::Method::kPercentile}));
  }
  row.result = std::move(result);
  return row;
}

// Best first by the set's first metric; before that, those that have it of more sequences, since a
// mean over the easier ones says nothing of the others.
void Rank(std::vector<LeaderboardRow>& rows, const BenchSet& set) {
  const bool higher = FindMetric(set.metrics.front())->better == Better::kHigher;
  std::stable_sort(rows.begin(), rows.end(), [&](const LeaderboardRow& a, const LeaderboardRow& b) {
    if (a.defined.front() != b.defined.front()) return a.defined.front() > b.defined.front();
    const Measured& x = a.means.front();
    const Measured& y = b.means.front();
    if (!x.value || !y.value) return false;
    return higher ? *x.value > *y.value : *x.value < *y.value;
  });
}

// A row a result: means over the sequences with their intervals, and who made it on what.
std::string MeansTable(const std::vector<LeaderboardRow>& rows, const BenchSet& set) {
  std::string page = "| method |";
  std::string rule = "\n| --- |";
  for (const std::string& metric : set.metrics) {
    const SweepMetric& words = *FindMetric(metric);
    page += fmt::format(" {}{} |", words.words,
                        words.unit.empty() ? "" : fmt::format(", {}", words.unit));
    rule += " --- |";
  }
  page += fmt::format(" version | commit | hardware |{} --- | --- | --- |\n", rule);
  for (const LeaderboardRow& row : rows) {
    page += fmt::format("| {} |", InMarkdown(row.result.method));
    for (std::size_t m = 0; m < set.metrics.size(); ++m) {
      const int decimals = FindMetric(set.metrics[m])->decimals;
      page += fmt::format(" {}", Text(row.means[m], decimals));
      if (const auto& interval = row.intervals[m].value) {
        page +=
            fmt::format(" [{:.{}f}, {:.{}f}]", interval->low, decimals, interval->high, decimals);
      }
      if (row.defined[m] > 0 && row.defined[m] < row.result.scores.size()) {
        page += fmt::format(" (of {} of {})", row.defined[m], row.result.scores.size());
      }
      page += " |";
    }
    page += fmt::format(" {} | {} | {} |\n", InMarkdown(row.result.version),
                        InMarkdown(row.result.commit), InMarkdown(row.result.hardware));
  }
  return page;
}

// Every figure of a metric: a row a result, a column a sequence.
std::string SequencesTable(const std::vector<LeaderboardRow>& rows, const BenchSet& set,
                           const std::string& metric) {
  const SweepMetric& words = *FindMetric(metric);
  std::string page = fmt::format("\n## {}\n\n| method |", words.words);
  std::string rule = "\n| --- |";
  for (const BenchSequence& sequence : set.sequences) {
    page += fmt::format(" {} |", sequence.name);
    rule += " --- |";
  }
  page += rule + "\n";
  for (const LeaderboardRow& row : rows) {
    page += fmt::format("| {} |", InMarkdown(row.result.method));
    for (const BenchSequence& sequence : set.sequences) {
      page += fmt::format(" {} |",
                          Text(row.result.scores.at(sequence.name).at(metric), words.decimals));
    }
    page += "\n";
  }
  return page;
}

}  // namespace

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
          {"kind", kKind},
          {"bench_set", set.name},
          {"bench_hash", set.hash},
          {"method", {{"name", method}, {"version", result.program}, {"commit", commit}}},
          {"hardware", HardwareJson()},
          {"renderer", result.renderer},
          {"entries", entries}};
}

Expected<void> CheckPlaceOfResult(const BenchSet& set, const std::string& method,
                                  const fs::path& file) {
  std::error_code failure;
  const fs::file_status there = fs::symlink_status(file, failure);
  if (!fs::exists(there)) return {};
  const auto result = ReadJsonObject(file);
  if (result && fs::is_regular_file(there)) {
    const json maker = result->value("method", json());
    if (result->value("kind", json()) == kKind && result->value("bench_set", json()) == set.name &&
        maker.is_object() && maker.value("name", json()) == method) {
      return {};
    }
  }
  return UsageError("{}: is of no earlier run and would be replaced, expected another folder",
                    file.string());
}

Expected<BenchResult> ReadBenchResult(const BenchSet& set, const fs::path& file) {
  const std::string where = file.string();
  TSDFPP_ASSIGN(const json root, ReadJsonObject(file));
  TSDFPP_RETURN_IF_ERROR(CheckHead(root, set, where));
  BenchResult result;
  result.file = file.filename().string();
  try {
    result.method = root.at("method").at("name");
    result.version = root.at("method").at("version");
    result.commit = root.at("method").at("commit");
    result.hardware = HardwareText(root.at("hardware"));
    for (const json& entry : root.at("entries")) {
      TSDFPP_RETURN_IF_ERROR(ReadEntry(entry, where, result));
    }
  } catch (const json::exception& error) {
    return DataError("{}: a field is missing or wrong ({})", where, WithoutTag(error.what()));
  }
  TSDFPP_RETURN_IF_ERROR(CheckComplete(result, set, where));
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
  std::vector<LeaderboardRow> rows;
  for (const fs::path& file : files) {
    TSDFPP_ASSIGN(BenchResult result, ReadBenchResult(set, file));
    rows.push_back(RowOf(std::move(result), set));
  }
  Rank(rows, set);
  std::string page = fmt::format(
      "# Benchmark {}\n\n{} sequences, images of {} times the scenes' size, voxels of {} m, "
      "truncation {} voxels in front and {} behind; set\nfile hash {}. Means over the sequences, "
      "with 95 % bootstrap intervals; `-` is undefined.\n\n",
      set.name, set.sequences.size(), set.scale, set.voxel_m, set.trunc_front, set.trunc_back,
      set.hash);
  page += MeansTable(rows, set);
  for (const std::string& metric : set.metrics) page += SequencesTable(rows, set, metric);
  return page;
}

}  // namespace tsdfpp
