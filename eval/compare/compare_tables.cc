#include "eval/compare/compare_tables.h"

#include <algorithm>
#include <array>

#include "core/one_line.h"
#include "eval/score/evaluation_columns.h"

namespace tsdfpp {
namespace {

// Characters of UTF-8.
std::size_t WidthOf(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

double MedianMs(const nlohmann::json& spread) {
  return spread.is_null() ? 0 : spread["median_ms"].get<double>();
}

using Rows = std::vector<std::vector<std::string>>;

// The first column to the left, the others to the right.
std::string Aligned(const Rows& rows) {
  std::vector<std::size_t> width(rows[0].size(), 0);
  for (const auto& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], WidthOf(row[c]));
  }
  std::string text;
  for (const auto& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) {
      text += c == 0 ? fmt::format("{:<{}}", row[c], width[c])
                     : fmt::format("  {:>{}}", row[c], width[c]);
    }
    text += "\n";
  }
  return text;
}

// What a front table shows of each map in each profile.
struct FrontColumn {
  const char* title;
  const char* csv;
};
constexpr std::array<FrontColumn, 3> kFrontColumns{
    {{"table kept", "table_preservation_behind_other"},
     {"objects", "movers_completion"},
     {"worst object", "sanity_least"}}};

const EvaluationColumn& ColumnOf(const char* csv) {
  const auto& columns = EvaluationColumns();
  return *std::find_if(columns.begin(), columns.end(),
                       [&](const EvaluationColumn& column) { return column.csv == csv; });
}

// The method, and where its poses come from if that differs among the runs.
std::string FrontTitle(const CompareResult& result, const CompareRun& run) {
  std::string method(MethodName(run.config.method));
  if (result.config.poses.size() < 2) return method;
  return fmt::format("{}, {} poses", method, PoseSourceName(run.config.poses));
}

}  // namespace

const Evaluation& Examined(const CompareResult& result,
                           const std::vector<Evaluation>& evaluations) {
  for (const Evaluation& evaluation : evaluations) {
    if (evaluation.frame == result.reveal_frame) return evaluation;
  }
  return evaluations.back();
}

const Evaluation& Examined(const CompareResult& result, const CompareRun& run) {
  return Examined(result, run.evaluations);
}

const MapMemory& ExaminedMemory(const CompareResult& result, const CompareRun& run) {
  return run.memory[static_cast<std::size_t>(&Examined(result, run) - run.evaluations.data())];
}

// "open3d (any label)" where it tells no objects apart.
std::string TitleOf(const AdapterRun& run) {
  return run.config.name + (run.evaluations.back().labelled ? "" : " (any label)");
}

std::vector<std::vector<std::string>> TableRows(const CompareResult& result, Times times) {
  std::vector<std::vector<std::string>> rows(1);
  rows[0] = {"map"};
  for (const EvaluationColumn& column : EvaluationColumns()) rows[0].push_back(column.title);
  const bool timed = times == Times::kShown;
  if (timed) rows[0].insert(rows[0].end(), {"move ms", "fuse ms"});
  rows[0].emplace_back("MB");
  for (const auto& run : result.runs) {
    const Evaluation& evaluation = Examined(result, *run);
    std::vector<std::string> row{run->Title()};
    for (const EvaluationColumn& column : EvaluationColumns()) {
      row.push_back(ColumnText(column, result.movers, evaluation));
    }
    if (timed) {
      const nlohmann::json spread = run->notes.times.ToJson();
      row.push_back(fmt::format("{:.1f}", MedianMs(spread["update_poses"])));
      row.push_back(fmt::format("{:.1f}", MedianMs(spread["fuse"])));
    }
    row.push_back(
        fmt::format("{:.0f}", static_cast<double>(ExaminedMemory(result, *run).bytes) / 1e6));
    rows.push_back(std::move(row));
  }
  for (const auto& run : result.adapters) {
    if (run->failure) continue;
    const Evaluation& evaluation = Examined(result, run->evaluations);
    std::vector<std::string> row{TitleOf(*run)};
    for (const EvaluationColumn& column : EvaluationColumns()) {
      row.push_back(ColumnText(column, result.movers, evaluation));
    }
    row.resize(rows[0].size(), "-");  // its times and memory are another program's
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<std::string> FailureLines(const CompareResult& result) {
  std::vector<std::string> lines;
  for (const FailedRun& run : result.failed) {
    lines.push_back(fmt::format("failed: {} at frame {}: {}", run.title, run.frame,
                                OneLine(run.error.message)));
  }
  if (result.stopped) {
    lines.push_back(fmt::format("stopped after frame {}: {}", result.last_frame,
                                OneLine(result.stopped->message)));
  }
  return lines;
}

std::vector<std::string> AdapterLines(const CompareResult& result) {
  std::vector<std::string> lines;
  for (const auto& run : result.adapters) {
    const std::string cost =
        fmt::format("{:.1f} s, {:.1f} s of CPU, at most {:.0f} MB", run->outcome.wall_s,
                    run->outcome.cpu_s, static_cast<double>(run->outcome.peak_bytes) / 1e6);
    lines.push_back(run->failure ? fmt::format("failed: {} ({})", run->failure->message, cost)
                                 : fmt::format("{}: {}", run->config.name, cost));
    for (const std::string& remark : run->remarks) {
      lines.push_back(fmt::format("{}: {}", run->config.name, remark));
    }
  }
  return lines;
}

std::string FrontTable(const CompareResult& result) {
  if (result.runs.empty()) return "";
  const std::vector<std::string>& profiles = result.config.profiles;
  std::vector<std::string> maps;  // titles, in the order of the runs
  for (const auto& run : result.runs) {
    const std::string title = FrontTitle(result, *run);
    if (std::find(maps.begin(), maps.end(), title) == maps.end()) maps.push_back(title);
  }
  Rows rows{{"map"}};
  for (const std::string& profile : profiles) {
    for (const FrontColumn& column : kFrontColumns) {
      rows[0].push_back(fmt::format("{}: {}", profile, column.title));
    }
  }
  for (const std::string& map : maps) {
    std::vector<std::string> row(rows[0].size(), "-");
    row[0] = map;
    for (const auto& run : result.runs) {
      if (FrontTitle(result, *run) != map) continue;
      const auto profile = std::find(profiles.begin(), profiles.end(), run->profile);
      std::size_t at =
          1 + kFrontColumns.size() * static_cast<std::size_t>(profile - profiles.begin());
      for (const FrontColumn& front : kFrontColumns) {
        const EvaluationColumn& column = ColumnOf(front.csv);
        row[at++] = ColumnText(column, result.movers, Examined(result, *run));
      }
    }
    rows.push_back(std::move(row));
  }
  return fmt::format(
             "{} at frame {}: share of the hidden table kept after removing {} moving objects, "
             "completion of these objects,\nshare of right pixels of the worst object; threshold "
             "one "
             "voxel\n",
             result.info.name, result.reveal_frame.value_or(result.last_frame),
             result.movers.size()) +
         Aligned(rows) + "\n";
}

std::string SummaryTable(const CompareResult& result, Times times) {
  std::string text = fmt::format(
      "{} at frame {}, the table after removing {} moving objects; threshold one voxel\n",
      result.info.name, result.reveal_frame.value_or(result.last_frame), result.movers.size());
  text += Aligned(TableRows(result, times));
  for (const std::string& line : FailureLines(result)) text += line + "\n";
  if (times == Times::kShown) {
    for (const std::string& line : AdapterLines(result)) text += line + "\n";
  }
  if (!result.config.truth_note.empty()) text += result.config.truth_note + "\n";
  return text;
}

}  // namespace tsdfpp
