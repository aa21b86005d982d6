#include "sim/config/sensor_config.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/toml_reader.h"
#include "core/types.h"

namespace tsdfpp {
namespace {

constexpr double kMaxDepth_m = kMaxValidDepth_m;
constexpr int kMaxFaultFrames = 1000;
constexpr int kMaxFaultPixels = 32;
constexpr int kMaxSubFrames = 256;

template <typename Timing, typename Visitor>
void VisitTiming(Timing& timing, Visitor& visit) {
  visit.Number("rate", timing.rate, 0.0, 1.0);
  visit.Number("frames", timing.frames, 1, kMaxFaultFrames);
}

template <typename Timing, typename Visitor>
void VisitFault(const char* name, Timing& timing, Visitor& visit) {
  visit.Enter(name);
  VisitTiming(timing, visit);
  visit.Leave();
}

template <typename Fault, typename Visitor>
void VisitPixelFault(const char* name, Fault& fault, Visitor& visit) {
  visit.Enter(name);
  VisitTiming(fault.timing, visit);
  visit.Number("pixels", fault.pixels, 1, kMaxFaultPixels);
  visit.Leave();
}

// Every key with its range, in the order in which it is written. Config is SensorConfig or const.
template <typename Config, typename Visitor>
void VisitKeys(Config& config, Visitor& visit) {
  auto& depth = config.depth;
  visit.Enter("depth");
  visit.Model("model", depth.model);
  visit.Number("noise_scale", depth.noise_scale, 0.0, 100.0);
  visit.Number("shadow_baseline_m", depth.shadow_baseline_m, 0.0, 1.0);
  visit.Number("flying_pixel_rate", depth.flying_pixel_rate, 0.0, 1.0);
  visit.Number("flying_pixel_step_m", depth.flying_pixel_step_m, 1e-4, kMaxDepth_m);
  visit.Number("dropout_incidence_start_deg", depth.dropout_incidence_start_deg, 0.0, 90.0);
  visit.Number("dropout_incidence_end_deg", depth.dropout_incidence_end_deg, 0.0, 90.0);
  visit.Number("dropout_range_start_m", depth.dropout_range_start_m, 0.0, kMaxDepth_m);
  visit.Number("dropout_range_end_m", depth.dropout_range_end_m, 0.0, kMaxDepth_m);
  visit.Number("min_range_m", depth.min_range_m, 0.0, kMaxDepth_m);
  visit.Number("max_range_m", depth.max_range_m, 0.0, kMaxDepth_m);
  visit.Number("unit_m", depth.unit_m, 0.0, 1.0);
  visit.Leave();

  auto& colour = config.colour;
  visit.Enter("colour");
  visit.Number("exposure_ev", colour.exposure_ev, -10.0, 10.0);
  visit.Number("exposure_jitter_ev", colour.exposure_jitter_ev, 0.0, 10.0);
  visit.Number("vignetting", colour.vignetting, 0.0, 1.0);
  visit.Number("full_well_electrons", colour.full_well_electrons, 0.0, 1e9);
  visit.Number("noise_levels", colour.noise_levels, 0.0, 255.0);
  visit.Leave();

  auto& shutter = config.shutter;
  visit.Enter("shutter");
  visit.Number("exposure_s", shutter.exposure_s, 0.0, 10.0);
  visit.Number("readout_s", shutter.readout_s, 0.0, 10.0);
  visit.Number("sub_frames", shutter.sub_frames, 1, kMaxSubFrames);
  visit.Leave();

  auto& pose = config.camera_pose;
  visit.Enter("camera_pose");
  visit.Number("drift_m", pose.drift_m, 0.0, 1.0);
  visit.Number("drift_deg", pose.drift_deg, 0.0, 10.0);
  visit.Number("jitter_m", pose.jitter_m, 0.0, 1.0);
  visit.Number("jitter_deg", pose.jitter_deg, 0.0, 45.0);
  visit.Leave();

  auto& masks = config.masks;
  visit.Enter("masks");
  VisitFault("missing", masks.missing, visit);
  VisitPixelFault("undershoot", masks.undershoot, visit);
  VisitPixelFault("bleed", masks.bleed, visit);
  VisitFault("split", masks.split, visit);
  VisitPixelFault("merged", masks.merged, visit);
  VisitFault("flicker", masks.flicker, visit);
  VisitFault("wrong_class", masks.wrong_class, visit);
  visit.Leave();
}

template <typename T>
std::string RangeFault(T value, T low, T high) {
  if (value >= low && value <= high) return {};
  return fmt::format("is {}, expected {} to {}", value, low, high);
}

// Keys whose values contradict each other.
struct Contradiction {
  std::string section;
  std::string key;
  std::string sentence;
};

std::optional<Contradiction> FindContradiction(const SensorConfig& config) {
  const DepthSensorConfig& depth = config.depth;
  const auto below = [](const char* key, double end, const char* other,
                        double start) -> std::optional<Contradiction> {
    if (end >= start) return std::nullopt;
    return Contradiction{"depth", key,
                         fmt::format("is {}, expected {} ({}) at least", end, other, start)};
  };
  if (auto fault = below("dropout_incidence_end_deg", depth.dropout_incidence_end_deg,
                         "dropout_incidence_start_deg", depth.dropout_incidence_start_deg)) {
    return fault;
  }
  if (auto fault = below("dropout_range_end_m", depth.dropout_range_end_m, "dropout_range_start_m",
                         depth.dropout_range_start_m)) {
    return fault;
  }
  if (auto fault = below("max_range_m", depth.max_range_m, "min_range_m", depth.min_range_m)) {
    return fault;
  }
  const ShutterConfig& shutter = config.shutter;
  const bool moves = shutter.exposure_s > 0 || shutter.readout_s > 0;
  if (moves && shutter.sub_frames < 2) {
    return Contradiction{"shutter", "sub_frames",
                         fmt::format("is {}, expected 2 at least where exposure_s or readout_s is "
                                     "above 0",
                                     shutter.sub_frames)};
  }
  if (!moves && shutter.sub_frames > 1) {
    return Contradiction{
        "shutter", "sub_frames",
        fmt::format("is {}, expected 1 where exposure_s and readout_s are 0", shutter.sub_frames)};
  }
  return std::nullopt;
}

// Reads the keys of the tables that are there.
class KeyReader {
 public:
  KeyReader(const toml::table& table, const std::string& where, const std::string& path)
      : where_(where), path_(path) {
    readers_.push_back(std::make_unique<TomlReader>(table, where, path));
  }

  TomlReader& root() { return *readers_.front(); }

  void Enter(const char* name) {
    TomlReader* parent = readers_.back().get();
    const toml::table* table = parent != nullptr ? parent->Table(name) : nullptr;
    readers_.push_back(table != nullptr
                           ? std::make_unique<TomlReader>(*table, where_, parent->PathOf(name))
                           : nullptr);
  }
  void Leave() {
    if (TomlReader* reader = readers_.back().get()) Keep(reader->Finish());
    readers_.pop_back();
  }
  template <typename T>
  void Number(const char* key, T& value, T low, T high) {
    TomlReader* reader = readers_.back().get();
    if (reader == nullptr) return;
    reader->Get(key, value);
    const std::string fault = RangeFault(value, low, high);
    if (!fault.empty()) reader->Fault(key, fault);
  }
  void Model(const char* key, DepthModel& model) {
    TomlReader* reader = readers_.back().get();
    if (reader == nullptr) return;
    std::string name(DepthModelName(model));
    reader->Get(key, name);
    const std::vector<std::string>& names = DepthModelNames();
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) {
      reader->Fault(key, fmt::format("is '{}', expected one of: {}", name, fmt::join(names, ", ")));
      return;
    }
    model = static_cast<DepthModel>(found - names.begin());
  }
  Expected<void> Finish() {
    Keep(root().Finish());
    return first_;
  }

 private:
  void Keep(Expected<void> result) {
    if (first_.has_value()) first_ = std::move(result);
  }

  const std::string where_;
  const std::string path_;
  std::vector<std::unique_ptr<TomlReader>> readers_;
  Expected<void> first_;
};

// Finds the first value out of its range.
class KeyChecker {
 public:
  void Enter(const char* name) { path_.emplace_back(name); }
  void Leave() { path_.pop_back(); }
  template <typename T>
  void Number(const char* key, T value, T low, T high) {
    const std::string fault = RangeFault(value, low, high);
    if (fault.empty() || !fault_.empty()) return;
    fault_ = fmt::format("'sensor.{}.{}' {}", fmt::join(path_, "."), key, fault);
  }
  void Model(const char* /*key*/, DepthModel /*model*/) {}
  const std::string& fault() const { return fault_; }

 private:
  std::vector<std::string> path_;
  std::string fault_;
};

// Every key as text.
struct KeyText {
  std::string section;  // e.g. "masks.bleed"
  std::string key;
  std::string value;  // as in TOML
  bool operator==(const KeyText&) const = default;
};

class KeyLister {
 public:
  void Enter(const char* name) { path_.emplace_back(name); }
  void Leave() { path_.pop_back(); }
  template <typename T>
  void Number(const char* key, T value, T /*low*/, T /*high*/) {
    // The shortest text that reads back to the same number.
    texts.push_back({fmt::format("{}", fmt::join(path_, ".")), key, fmt::format("{}", value)});
  }
  void Model(const char* key, DepthModel model) {
    texts.push_back({fmt::format("{}", fmt::join(path_, ".")), key,
                     fmt::format("\"{}\"", DepthModelName(model))});
  }
  std::vector<KeyText> texts;

 private:
  std::vector<std::string> path_;
};

std::vector<KeyText> ListKeys(const SensorConfig& config) {
  KeyLister lister;
  VisitKeys(config, lister);
  return std::move(lister.texts);
}

}  // namespace

const std::vector<std::string>& DepthModelNames() {
  static const std::vector<std::string> kNames = {"exact",    "nguyen2012", "icl_nuim", "simkinect",
                                                  "cofusion", "redwood",    "azure",    "d435"};
  return kNames;
}

std::string_view DepthModelName(DepthModel model) {
  return DepthModelNames().at(static_cast<std::size_t>(model));
}

Expected<void> ValidateSensorConfig(const SensorConfig& config) {
  KeyChecker checker;
  VisitKeys(config, checker);
  if (!checker.fault().empty()) return UsageError("{}", checker.fault());
  if (const auto fault = FindContradiction(config)) {
    return UsageError("'sensor.{}.{}' {}", fault->section, fault->key, fault->sentence);
  }
  return {};
}

Expected<void> CheckSamples(const SensorConfig& sensor, const Intrinsics& camera,
                            const std::string& where) {
  constexpr std::int64_t kMostSamples = std::int64_t{1} << 28;
  const std::int64_t samples =
      std::int64_t{camera.width} * camera.height * sensor.shutter.sub_frames;
  if (samples <= kMostSamples) return {};
  return UsageError(
      "{}: 'sensor.shutter.sub_frames' is {}, with which a frame of {} x {} pixels has {} samples, "
      "expected {} at most",
      where, sensor.shutter.sub_frames, camera.width, camera.height, samples, kMostSamples);
}

Expected<SensorConfig> ReadSensorConfig(const toml::table& table, const std::string& where,
                                        const std::string& path) {
  KeyReader reader(table, where, path);
  std::string preset = "exact";
  reader.root().Get("preset", preset);
  SensorConfig config;
  if (const auto start = SensorPresetNamed(preset)) {
    config = *start;
  } else {
    reader.root().Fault("preset", fmt::format("is '{}': {}", preset, start.error().message));
  }
  VisitKeys(config, reader);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (const auto fault = FindContradiction(config)) {
    const toml::table* section = table[fault->section].as_table();
    TomlReader at(section != nullptr ? *section : table, where,
                  fmt::format("{}.{}", path, fault->section));
    at.Fault(fault->key, fault->sentence);
    return tl::unexpected(at.Finish().error());
  }
  return config;
}

std::string SensorConfigToToml(const SensorConfig& config) {
  std::string text;
  std::string section;
  for (const KeyText& entry : ListKeys(config)) {
    if (entry.section != section) {
      section = entry.section;
      text += fmt::format("{}[sensor.{}]\n", text.empty() ? "" : "\n", section);
    }
    text += fmt::format("{} = {}\n", entry.key, entry.value);
  }
  return text;
}

std::string DescribeSensor(const SensorConfig& config) {
  const std::vector<KeyText> exact = ListKeys(SensorConfig{});
  const std::vector<KeyText> texts = ListKeys(config);
  std::vector<std::string> parts;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    if (texts[i] == exact[i]) continue;
    parts.push_back(fmt::format("{}.{} = {}", texts[i].section, texts[i].key, texts[i].value));
  }
  return parts.empty() ? "exact" : fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace tsdfpp
