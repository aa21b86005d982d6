#include "bench/track_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "bench/figure_runs.h"
#include "metrics/statistics.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// Turns are judged where the terms on the true surface know of each at least this share, which a
// ball's do not.
constexpr double kFixedTurn = 0.01;
// Between these the squared errors of motions are called as large as the covariance says.
constexpr double kLeastNees = 0.5;
constexpr double kMostNees = 2;

std::string Scaled(const Measured& value, double factor, int digits) {
  return value.value ? Cell(*value.value * factor, digits) : std::string();
}

Expected<void> WriteObjects(const std::vector<TrackRow>& rows, const fs::path& out) {
  FigureTable table({"scene",
                     "depth",
                     "seed",
                     "run",
                     "object",
                     "moved cm",
                     "ATE mm",
                     "farthest mm",
                     "end mm",
                     "rotation deg",
                     "Co-Fusion ATE mm",
                     "RPE mm",
                     "RPE deg",
                     "ADD mm",
                     "ADD-S mm",
                     "within 5 mm",
                     "within 2 cm",
                     "shown",
                     "tracked",
                     "stayed",
                     "frozen",
                     "known of shifts",
                     "known of turns",
                     "NEES",
                     "free directions"});
  for (const TrackRow& row : rows) {
    const TrackScores& s = row.scores;
    table.Add({row.scene,
               row.depth,
               std::to_string(row.seed),
               row.run,
               row.object,
               Cell(100 * s.moved_m, 1),
               Scaled(s.trajectory.ate_rmse_m, 1e3, 2),
               Cell(1e3 * s.farthest_m, 2),
               Cell(1e3 * s.end_m, 2),
               Scaled(s.trajectory.rotation_rmse_deg, 1, 2),
               Scaled(s.trajectory.cofusion_rmse_m, 1e3, 2),
               Scaled(s.trajectory.rpe_rmse_m, 1e3, 2),
               Scaled(s.trajectory.rpe_rmse_deg, 1, 2),
               Scaled(s.add_m, 1e3, 2),
               Scaled(s.add_s_m, 1e3, 2),
               Scaled(s.within_5mm, 1, 3),
               Scaled(s.within_2cm, 1, 3),
               std::to_string(row.shown),
               std::to_string(row.span.tracked),
               std::to_string(row.span.stayed),
               std::to_string(row.span.frozen),
               Cell(row.shift_share, 4),
               Cell(row.turn_share, 4),
               Scaled(s.nees, 1, 2),
               Cell(s.free_directions, 2)});
  }
  return table.Write(out, "objects");
}

// The median over the seeds of the medians over their objects, with the least and the largest of
// these where they are several; and the worst of all objects.
struct SeedCells {
  std::size_t objects = 0;  // of one seed, the most
  std::string median;
  std::string worst;
};
SeedCells CellsOf(const std::map<std::uint64_t, std::vector<double>>& by_seed, int digits) {
  SeedCells cells;
  std::vector<double> medians;
  double worst = 0;
  for (const auto& [seed, values] : by_seed) {
    cells.objects = std::max(cells.objects, values.size());
    medians.push_back(MedianOf(values));
    worst = std::max(worst, *std::ranges::max_element(values));
  }
  if (medians.empty()) return cells;
  cells.median = Cell(MedianOf(medians), digits);
  cells.worst = Cell(worst, digits);
  if (medians.size() > 1) {
    cells.median += fmt::format(" [{} to {}]", Cell(*std::ranges::min_element(medians), digits),
                                Cell(*std::ranges::max_element(medians), digits));
  }
  return cells;
}

// A row a scene and depth: of each run the median and the largest over the objects.
template <typename ValueOf>
Expected<void> WriteByScene(const std::vector<TrackRow>& rows, const TrackTables& tables,
                            const fs::path& out, const std::string& name, int digits,
                            const ValueOf& value_of) {
  std::vector<std::string> columns{"scene", "depth", "objects"};
  for (const std::string& run : tables.runs) {
    columns.push_back(run + ": median");
    columns.push_back(run + ": worst");
  }
  FigureTable table(std::move(columns));
  std::vector<std::pair<std::string, std::string>> keys;  // in order
  for (const TrackRow& row : rows) {
    const std::pair key{row.scene, row.depth};
    if (std::ranges::count(keys, key) == 0) keys.push_back(key);
  }
  for (const auto& [scene, depth] : keys) {
    std::vector<std::string> cells{scene, depth, ""};
    for (const std::string& run : tables.runs) {
      std::map<std::uint64_t, std::vector<double>> by_seed;
      for (const TrackRow& row : rows) {
        if (row.scene != scene || row.depth != depth || row.run != run) continue;
        if (const std::optional<double> value = value_of(row)) by_seed[row.seed].push_back(*value);
      }
      SeedCells of_run = CellsOf(by_seed, digits);
      cells[2] = std::to_string(of_run.objects);
      cells.push_back(std::move(of_run.median));
      cells.push_back(std::move(of_run.worst));
    }
    table.Add(std::move(cells));
  }
  return table.Write(out, name);
}

Expected<void> WriteTimes(const std::vector<TrackRow>& rows, const fs::path& out) {
  FigureTable table({"scene", "depth", "seed", "run", "ms an object and frame"});
  const TrackRow* before = nullptr;  // rows of a run follow each other
  for (const TrackRow& row : rows) {
    const bool is_same = before != nullptr && before->scene == row.scene &&
                         before->depth == row.depth && before->seed == row.seed &&
                         before->run == row.run;
    if (!is_same) {
      table.Add({row.scene, row.depth, std::to_string(row.seed), row.run, Cell(row.ms, 2)});
    }
    before = &row;
  }
  return table.Write(out, "times");
}

// A row a depth and run, over the scenes and objects.
Expected<void> WriteUncertainty(const std::vector<TrackRow>& rows, const TrackTables& tables,
                                const fs::path& out) {
  FigureTable table({"depth", "run", "objects", "0.5 to 2", "least", "median", "largest"});
  for (const std::string& depth : tables.depths) {
    for (const std::string& run : tables.runs) {
      std::vector<double> values;
      for (const TrackRow& row : rows) {
        if (row.depth != depth || row.run != run || !row.scores.nees.value) continue;
        values.push_back(*row.scores.nees.value);
      }
      if (values.empty()) continue;
      const auto honest = std::ranges::count_if(
          values, [](double value) { return value >= kLeastNees && value <= kMostNees; });
      table.Add({depth, run, std::to_string(values.size()), std::to_string(honest),
                 Cell(*std::ranges::min_element(values), 2), Cell(MedianOf(values), 2),
                 Cell(*std::ranges::max_element(values), 2)});
    }
  }
  return table.Write(out, "uncertainty");
}

}  // namespace

Expected<void> WriteTrackTables(const std::vector<TrackRow>& rows, const TrackTables& tables,
                                const fs::path& out) {
  TSDFPP_RETURN_IF_ERROR(WriteObjects(rows, out));
  TSDFPP_RETURN_IF_ERROR(WriteByScene(rows, tables, out, "shifts", 2, [](const TrackRow& row) {
    const auto& ate_m = row.scores.trajectory.ate_rmse_m.value;
    return ate_m ? std::optional(1e3 * *ate_m) : std::nullopt;
  }));
  TSDFPP_RETURN_IF_ERROR(WriteByScene(rows, tables, out, "turns", 2, [](const TrackRow& row) {
    return row.turn_share < kFixedTurn ? std::nullopt
                                       : row.scores.trajectory.rotation_rmse_deg.value;
  }));
  TSDFPP_RETURN_IF_ERROR(WriteUncertainty(rows, tables, out));
  return WriteTimes(rows, out);
}

}  // namespace tsdfpp
