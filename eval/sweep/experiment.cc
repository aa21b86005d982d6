#include "eval/sweep/experiment.h"

#include <algorithm>
#include <charconv>

#include "core/files.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kMostCells = 100'000;

bool Has(const std::vector<std::string>& words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

// One value or an array of them.
std::vector<AxisValue> ReadValues(TomlReader& reader, const toml::table& table,
                                  const std::string& key) {
  const toml::node* node = table.get(key);
  if (node == nullptr) return {};
  std::vector<AxisValue> values;
  if (const toml::array* array = node->as_array()) {
    if (array->empty()) {
      reader.Fault(key, "is empty, expected one value at least");
    } else if (array->front().is_string()) {
      std::vector<std::string> words;
      reader.Get(key, words);
      for (std::string& word : words) values.emplace_back(std::move(word));
      return values;
    }
    std::vector<double> numbers;
    reader.Get(key, numbers);
    for (const double number : numbers) values.emplace_back(number);
  } else if (node->is_string()) {
    std::string word;
    reader.Get(key, word);
    values.emplace_back(std::move(word));
  } else {
    double number = 0;
    reader.Get(key, number);
    values.emplace_back(number);
  }
  return values;
}

void ReadAxes(TomlReader& reader, const toml::table& table, ExperimentGrid::Values& all) {
  for (const Axis& axis : Axes()) {
    if (!table.contains(axis.name)) continue;
    std::vector<AxisValue> values = ReadValues(reader, table, axis.name);
    std::vector<AxisValue> kept;
    for (const AxisValue& value : values) {
      CellSettings probe;
      if (auto set = axis.set(probe, value); !set) {
        reader.Fault(axis.name, set.error().message);
        continue;
      }
      // As the settings have it: "anchored" is "tsdf++/anchored".
      const AxisValue canonical = axis.get(probe);
      if (std::find(kept.begin(), kept.end(), canonical) != kept.end()) {
        reader.Fault(axis.name, fmt::format("holds {} twice", AxisText(canonical)));
      }
      kept.push_back(canonical);
    }
    all[axis.name] = std::move(kept);
  }
}

Expected<void> ReadGrid(TomlReader& reader, const toml::table& table, ExperimentGrid& grid) {
  ReadAxes(reader, table, grid.values);
  for (const toml::table* exception : reader.Tables("except")) {
    TomlReader of_exception(*exception, reader.where(), reader.PathOf("except"));
    ReadAxes(of_exception, *exception, grid.except.emplace_back());
    TSDFPP_RETURN_IF_ERROR(of_exception.Finish());
  }
  return reader.Finish();
}

void ReadMetrics(TomlReader& reader, std::vector<std::string>& metrics, bool required) {
  reader.Get("metrics", metrics, required);
  for (const std::string& name : metrics) {
    if (FindMetric(name) != nullptr) continue;
    std::string known;
    for (const SweepMetric& metric : SweepMetrics()) {
      known += (known.empty() ? "" : ", ") + metric.name;
    }
    reader.Fault("metrics", fmt::format("holds '{}', expected one of {}", name, known));
  }
}

Expected<void> ReadFrames(const toml::table& table, const std::string& where, FrameChoice& frames) {
  TomlReader reader(table, where, "frames");
  reader.Get("scale", frames.scale).Get("stride", frames.stride).Get("every", frames.every);
  if (!(frames.scale >= 0.05 && frames.scale <= 4)) {
    reader.Fault("scale", fmt::format("is {}, expected a number from 0.05 to 4", frames.scale));
  }
  if (frames.stride < 1) {
    reader.Fault("stride", fmt::format("is {}, expected 1 or more", frames.stride));
  }
  if (frames.every < 0) {
    reader.Fault("every", fmt::format("is {}, expected 0 or more", frames.every));
  }
  const toml::node* until = table.get("until");
  if (until != nullptr && until->is_integer()) {
    int frame = 0;
    reader.Get("until", frame);
    frames.until = std::to_string(frame);
    if (frame < 1) reader.Fault("until", fmt::format("is {}, expected 1 or more", frame));
  } else {
    reader.Get("until", frames.until);
    if (frames.until != "reveal" && frames.until != "end") {
      reader.Fault("until", fmt::format("is '{}', expected \"reveal\", \"end\" or a frame's number",
                                        frames.until));
    }
  }
  return reader.Finish();
}

Expected<void> ReadStatistics(const toml::table& table, const std::string& where,
                              BootstrapConfig& statistics) {
  TomlReader reader(table, where, "statistics");
  std::string method = "percentile";
  int seed = static_cast<int>(statistics.seed);
  reader.Get("method", method)
      .Get("confidence", statistics.confidence)
      .Get("resamples", statistics.resamples)
      .Get("seed", seed);
  if (method != "percentile" && method != "bca") {
    reader.Fault("method", fmt::format("is '{}', expected percentile or bca", method));
  }
  if (!(statistics.confidence > 0 && statistics.confidence < 1)) {
    reader.Fault("confidence",
                 fmt::format("is {}, expected a number between 0 and 1", statistics.confidence));
  }
  if (statistics.resamples < 1) {
    reader.Fault("resamples", fmt::format("is {}, expected 1 or more", statistics.resamples));
  }
  if (seed < 0) reader.Fault("seed", fmt::format("is {}, expected 0 or more", seed));
  statistics.method =
      method == "bca" ? BootstrapConfig::Method::kBca : BootstrapConfig::Method::kPercentile;
  statistics.seed = static_cast<std::uint64_t>(seed);
  return reader.Finish();
}

Expected<PlotPlan> ReadPlot(const toml::table& table, const std::string& where,
                            const std::vector<std::string>& metrics) {
  PlotPlan plot;
  plot.metrics = metrics;
  TomlReader reader(table, where, "plot");
  reader.Get("x", plot.x, true).Get("log_x", plot.log_x);
  plot.x_label = plot.x;
  reader.Get("x_label", plot.x_label);
  ReadMetrics(reader, plot.metrics, false);
  if (plot.x != "frame" && plot.x != "difference" && FindAxis(plot.x) == nullptr) {
    reader.Fault("x",
                 fmt::format("is '{}', expected \"frame\", \"difference\" or an axis", plot.x));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return plot;
}

std::vector<CellSettings> AllCombinations(const ExperimentGrid& grid) {
  std::vector<CellSettings> made(1);
  for (const Axis& axis : Axes()) {
    const auto values = grid.values.find(axis.name);
    if (values == grid.values.end()) continue;
    std::vector<CellSettings> more;
    for (const CellSettings& settings : made) {
      for (const AxisValue& value : values->second) {
        more.push_back(settings);
        // Was set once when the file was read.
        if (!axis.set(more.back(), value)) std::abort();
      }
    }
    made = std::move(more);
  }
  return made;
}

// How many cells AllCombinations() makes, or any number above the most.
std::size_t CountCombinations(const ExperimentGrid& grid) {
  std::size_t count = 1;
  for (const auto& [axis, values] : grid.values) {
    count *= values.size();
    if (count > kMostCells) break;
  }
  return count;
}

// Whether the cell has, of each axis named, one of the values.
bool Fits(const CellSettings& settings, const ExperimentGrid::Values& values) {
  return std::all_of(values.begin(), values.end(), [&](const auto& named) {
    const auto& [axis, some] = named;
    return std::find(some.begin(), some.end(), FindAxis(axis)->get(settings)) != some.end();
  });
}

// An exception that leaves out nothing is a slip of the pen, as is one that leaves nothing.
void CheckExceptions(TomlReader& reader, const ExperimentGrid& grid) {
  std::vector<CellSettings> left = AllCombinations(grid);
  for (const ExperimentGrid::Values& exception : grid.except) {
    const auto count = std::erase_if(
        left, [&](const CellSettings& settings) { return Fits(settings, exception); });
    if (count == 0) {
      reader.Fault("except", fmt::format("leaves out no further cell of grid '{}'", grid.name));
    }
  }
  if (left.empty()) reader.Fault("except", fmt::format("leaves no cell of grid '{}'", grid.name));
}

// Sets that only show once the file is read whole.
void CheckTogether(TomlReader& reader, const ExperimentConfig& config) {
  for (const std::string& axis : config.replicates) {
    if (FindAxis(axis) == nullptr || axis == "method") {
      reader.Fault("replicates",
                   fmt::format("holds '{}', expected names of axes but method", axis));
    }
  }
  CellSettings probe;
  if (auto known = FindAxis("method")->set(probe, config.baseline); !known) {
    reader.Fault("baseline", known.error().message);
    return;
  }
  std::size_t cells = 0;
  for (const ExperimentGrid& grid : config.grids) {
    // Axes multiply: a short file can ask for more cells than memory holds.
    cells += CountCombinations(grid);
    if (cells > kMostCells) {
      reader.Fault("grid",
                   fmt::format("'{}' brings the cells to more than {}, expected that at most",
                               grid.name, kMostCells));
      return;
    }
    const auto methods = grid.values.find("method");
    const auto scenes = grid.values.find("scene");
    if (methods == grid.values.end() || scenes == grid.values.end()) {
      reader.Fault("grid", fmt::format("'{}' has no {}", grid.name,
                                       scenes == grid.values.end() ? "scene" : "method"));
      return;
    }
    if (methods->second.size() > 1 && std::find(methods->second.begin(), methods->second.end(),
                                                AxisValue(probe.method)) == methods->second.end()) {
      reader.Fault("baseline", fmt::format("is {}, which is not among the methods of grid '{}'",
                                           config.baseline, grid.name));
    }
    CheckExceptions(reader, grid);
  }
}

}  // namespace

Expected<ExperimentConfig> ExperimentConfig::Load(const std::filesystem::path& file) {
  auto text = ReadFile(file, &Limits::text_bytes);
  if (!text) return UsageError("{}", text.error().message);
  return Parse(*text, file);
}

Expected<ExperimentConfig> ExperimentConfig::Parse(std::string_view text,
                                                   const std::filesystem::path& file) {
  const std::string where = file.string();
  TSDFPP_ASSIGN(const toml::table root, ParseToml(text, where));
  ExperimentConfig config;
  config.file = file;
  TomlReader reader(root, where);
  reader.Get("name", config.name, true)
      .Get("question", config.question, true)
      .Get("baseline", config.baseline)
      .Get("replicates", config.replicates);
  const bool plain = !config.name.empty() &&
                     std::all_of(config.name.begin(), config.name.end(), [](unsigned char c) {
                       return std::isalnum(c) != 0 || c == '-' || c == '_';
                     });
  if (!plain) {
    reader.Fault("name", fmt::format("is '{}', expected letters, digits, - and _", config.name));
  }
  ReadMetrics(reader, config.metrics, true);
  if (config.metrics.empty()) reader.Fault("metrics", "is empty, expected one name at least");
  if (const toml::table* table = reader.Table("frames")) {
    TSDFPP_RETURN_IF_ERROR(ReadFrames(*table, where, config.frames));
  }
  if (const toml::table* table = reader.Table("statistics")) {
    TSDFPP_RETURN_IF_ERROR(ReadStatistics(*table, where, config.statistics));
  }
  if (const toml::table* table = reader.Table("plot")) {
    TSDFPP_ASSIGN(config.plot, ReadPlot(*table, where, config.metrics));
  }
  ExperimentGrid common;
  if (const toml::table* table = reader.Table("common")) {
    TomlReader of_common(*table, where, "common");
    TSDFPP_RETURN_IF_ERROR(ReadGrid(of_common, *table, common));
  }
  std::vector<std::string> names;
  for (const toml::table* table : reader.Tables("grid", true)) {
    ExperimentGrid grid = common;
    grid.name = std::to_string(config.grids.size() + 1);
    TomlReader of_grid(*table, where, "grid");
    of_grid.Get("name", grid.name);
    if (Has(names, grid.name))
      of_grid.Fault("name", fmt::format("is '{}', a second time", grid.name));
    names.push_back(grid.name);
    TSDFPP_RETURN_IF_ERROR(ReadGrid(of_grid, *table, grid));
    config.grids.push_back(std::move(grid));
  }
  if (config.grids.empty()) reader.Fault("grid", "is missing, expected one [[grid]] at least");
  CheckTogether(reader, config);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  CellSettings probe;
  if (FindAxis("method")->set(probe, config.baseline)) config.baseline = probe.method;
  return config;
}

std::vector<PlannedCell> CellsOf(const ExperimentConfig& config) {
  std::vector<PlannedCell> cells;
  for (const ExperimentGrid& grid : config.grids) {
    std::vector<CellSettings> made = AllCombinations(grid);
    for (const ExperimentGrid::Values& exception : grid.except) {
      std::erase_if(made, [&](const CellSettings& settings) { return Fits(settings, exception); });
    }
    for (CellSettings& settings : made) cells.push_back({grid.name, std::move(settings)});
  }
  return cells;
}

}  // namespace tsdfpp
