// What mapping cost in several runs, and how many times as fast as Open3D that is, as Markdown.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "bench/side_by_side_cases.h"
#include "metrics/statistics.h"

namespace tsdfpp {

// One run of a mapper: milliseconds of the frames that count, at least one, and the map's bytes.
struct SpeedRun {
  std::vector<double> ms;
  std::size_t bytes = 0;
};

struct Speed {
  std::string name;
  std::string how;             // of Open3D: how its threads wait
  std::vector<SpeedRun> runs;  // at least one

  // Medians over the runs of each run's median and of its worst frame.
  double MedianMs() const;
  double WorstMs() const;
  std::size_t Bytes() const { return runs.back().bytes; }
};

// Those of one number of threads; every method stands in `equal` and in `shipped`.
struct ThreadSpeeds {
  std::vector<Speed> peers;    // Open3D's volumes, once for each way of waiting
  std::vector<Speed> equal;    // pose updates and fusion, with colour in the whole band
  std::vector<Speed> shipped;  // fusion alone, with the settings that a user gets
};

struct CaseSpeeds {
  SideBySideCase of;
  std::map<int, ThreadSpeeds> by_threads;
};

// The one with the least median; of one at least.
const Speed& FastestOf(const std::vector<Speed>& speeds);

// How many times as fast `ours` is as `peer`: the median over the runs of peer's median / ours of
// the same run, with its 95 % percentile bootstrap interval over the runs, where they are two or
// more. Both must have the same runs.
struct TimesFaster {
  double median = 0;
  std::optional<Interval> interval;
};
TimesFaster CompareSpeeds(const Speed& peer, const Speed& ours);

// A row for each of Open3D's volumes and each method, all numbers of threads, and the names of
// Open3D's fastest.
std::string CaseTable(const CaseSpeeds& speeds);
// A row a method, two columns a case, of the largest number of threads.
std::string SummaryTable(const std::vector<CaseSpeeds>& cases);

}  // namespace tsdfpp
