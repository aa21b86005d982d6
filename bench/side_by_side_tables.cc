#include "bench/side_by_side_tables.h"

#include <fmt/format.h>

#include <algorithm>

namespace tsdfpp {
namespace {

template <typename Figure>
double MedianOverRuns(const std::vector<SpeedRun>& runs, const Figure& figure) {
  std::vector<double> values;
  for (const SpeedRun& run : runs) values.push_back(figure(run));
  return MedianOf(values);
}

std::string TextOf(const TimesFaster& faster) {
  const int decimals = faster.median < 2 ? 2 : 1;  // so that what is slower shows
  std::string text = fmt::format("{:.{}f}", faster.median, decimals);
  if (faster.interval) {
    text += fmt::format(" [{:.{}f}, {:.{}f}]", faster.interval->low, decimals,
                        faster.interval->high, decimals);
  }
  return text;
}

double Megabytes(const Speed& speed) { return 1e-6 * static_cast<double>(speed.Bytes()); }

const Speed& Named(const std::vector<Speed>& speeds, const std::string& name) {
  return *std::find_if(speeds.begin(), speeds.end(),
                       [&](const Speed& speed) { return speed.name == name; });
}

// Of each volume the way of waiting that is faster, in the order in which they were measured.
std::vector<Speed> FasterWays(const std::vector<Speed>& peers) {
  std::vector<Speed> faster;
  for (const Speed& peer : peers) {
    const auto found = std::find_if(faster.begin(), faster.end(),
                                    [&](const Speed& other) { return other.name == peer.name; });
    if (found == faster.end()) {
      faster.push_back(peer);
    } else if (peer.MedianMs() < found->MedianMs()) {
      *found = peer;
    }
  }
  return faster;
}

}  // namespace

double Speed::MedianMs() const {
  return MedianOverRuns(runs, [](const SpeedRun& run) { return MedianOf(run.ms); });
}

double Speed::WorstMs() const {
  return MedianOverRuns(runs, [](const SpeedRun& run) { return std::ranges::max(run.ms); });
}

const Speed& FastestOf(const std::vector<Speed>& speeds) {
  return *std::min_element(speeds.begin(), speeds.end(), [](const Speed& a, const Speed& b) {
    return a.MedianMs() < b.MedianMs();
  });
}

TimesFaster CompareSpeeds(const Speed& peer, const Speed& ours) {
  std::vector<double> ratios;
  for (std::size_t run = 0; run < ours.runs.size(); ++run) {
    ratios.push_back(MedianOf(peer.runs[run].ms) / MedianOf(ours.runs[run].ms));
  }
  const BootstrapConfig config{BootstrapConfig::Method::kPercentile};
  return {MedianOf(ratios), BootstrapInterval(ratios, MedianOf, config).value};
}

std::string CaseTable(const CaseSpeeds& speeds) {
  std::string header = "|  |";
  std::string line = "|---|";
  std::string fastest;
  std::map<std::string, std::string> rows;  // by name
  std::vector<std::string> order;
  const auto add = [&](const std::string& name, const std::string& cells) {
    if (!rows.contains(name)) order.push_back(name);
    rows[name] += cells;
  };
  for (const auto& [threads, of] : speeds.by_threads) {
    header += fmt::format(
        " {} T: equal work, ms | worst | x faster | fusion alone, as shipped, ms | x faster |",
        threads);
    line += "---|---|---|---|---|";
    const Speed& best = FastestOf(of.peers);
    fastest +=
        fmt::format("{}{} T: {}, {}", fastest.empty() ? "" : "; ", threads, best.name, best.how);
    for (const Speed& peer : FasterWays(of.peers)) {
      add(peer.name, fmt::format(" {:.1f} | {:.1f} | {} | - | - |", peer.MedianMs(), peer.WorstMs(),
                                 TextOf(CompareSpeeds(best, peer))));
    }
    for (const Speed& equal : of.equal) {
      const Speed& shipped = Named(of.shipped, equal.name);
      add(fmt::format("`{}`", equal.name),
          fmt::format(" {:.1f} | {:.1f} | {} | {:.1f} | {} |", equal.MedianMs(), equal.WorstMs(),
                      TextOf(CompareSpeeds(best, equal)), shipped.MedianMs(),
                      TextOf(CompareSpeeds(best, shipped))));
    }
  }
  header += " MB | MB as shipped |\n";
  line += "---|---|\n";
  const ThreadSpeeds& last = speeds.by_threads.rbegin()->second;
  for (const Speed& peer : FasterWays(last.peers)) {
    add(peer.name, fmt::format(" {:.0f} | - |", Megabytes(peer)));
  }
  for (const Speed& equal : last.equal) {
    add(fmt::format("`{}`", equal.name), fmt::format(" {:.0f} | {:.0f} |", Megabytes(equal),
                                                     Megabytes(Named(last.shipped, equal.name))));
  }
  std::string text = header + line;
  for (const std::string& name : order) text += fmt::format("| {} |{}\n", name, rows[name]);
  return text + fmt::format("\nOpen3D's fastest, that of the ratios: {}.\n", fastest);
}

std::string SummaryTable(const std::vector<CaseSpeeds>& cases) {
  const int threads = cases.front().by_threads.rbegin()->first;
  std::string header = fmt::format("| {} thread{} |", threads, threads == 1 ? "" : "s");
  std::string line = "|---|";
  std::string peers = "| Open3D's fastest |";
  std::map<std::string, std::string> rows;
  for (const CaseSpeeds& speeds : cases) {
    const ThreadSpeeds& of = speeds.by_threads.rbegin()->second;
    header += fmt::format(" {}: equal work | fusion alone, as shipped |", speeds.of.title);
    line += "---|---|";
    const Speed& best = FastestOf(of.peers);
    peers += fmt::format(" {:.1f} ms ({}) | - |", best.MedianMs(), best.name);
    const auto cell = [&](const Speed& speed) {
      return fmt::format(" {:.1f} ms, {} |", speed.MedianMs(), TextOf(CompareSpeeds(best, speed)));
    };
    for (const Speed& equal : of.equal) {
      rows[equal.name] += cell(equal) + cell(Named(of.shipped, equal.name));
    }
  }
  std::string text = fmt::format("{}\n{}\n{}\n", header, line, peers);
  for (const Speed& method : cases.front().by_threads.rbegin()->second.equal) {
    text += fmt::format("| `{}` |{}\n", method.name, rows[method.name]);
  }
  return text;
}

}  // namespace tsdfpp
