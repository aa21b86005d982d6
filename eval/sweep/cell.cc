#include "eval/sweep/cell.h"

#include <fmt/ranges.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/files.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "core/pose_text.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

template <typename T>
void Append(std::string& bytes, const std::vector<T>& values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

void Append(std::string& bytes, const cv::Mat& image) {
  for (int v = 0; v < image.rows; ++v) {
    bytes.append(image.ptr<char>(v), static_cast<std::size_t>(image.cols) * image.elemSize());
  }
}

// The values by the metrics' names.
nlohmann::json Named(const std::vector<Measured>& values) {
  nlohmann::json named;
  for (std::size_t i = 0; i < values.size(); ++i) {
    named[SweepMetrics()[i].name] = ToJson(values[i]);
  }
  return named;
}

// Throws what says why, as the next ones do, where it is no value that the metric can have.
Measured ValueFromJson(const nlohmann::json& value, const SweepMetric& metric) {
  if (!value.is_number()) {
    if (!value.at("value").is_null()) {
      throw std::out_of_range(fmt::format("{} is neither a number nor null", metric.name));
    }
    return Measured::Undefined(value.at("why"));
  }
  const double number = value.get<double>();
  const std::optional<double> most = MostOf(metric);
  if (!std::isfinite(number) || number < 0 || (most && number > *most + kShareRounding)) {
    throw std::out_of_range(fmt::format("{} is {}", metric.name, JsonShown(value)));
  }
  return Measured::Of(number);
}

std::vector<Measured> FromNamed(const nlohmann::json& named, std::size_t count) {
  std::vector<Measured> values;
  for (std::size_t i = 0; i < count; ++i) {
    const SweepMetric& metric = SweepMetrics()[i];
    values.push_back(ValueFromJson(named.at(metric.name), metric));
  }
  return values;
}

// Cells of one key may have settings in other words, such as another name of the scene: what was
// noted must stand for the same.
void CheckSettings(const nlohmann::json& noted, const CellSettings& settings) {
  if (noted == SettingsJson(settings)) return;
  const auto read = SettingsFromJson(noted);
  if (!read) throw std::out_of_range(read.error().message);
  const bool same = read->seed == settings.seed && read->fuse_until == settings.fuse_until &&
                    read->object_error == settings.object_error &&
                    read->sabotage == settings.sabotage && read->Pipeline() &&
                    MapKey(*read) == MapKey(settings);
  if (!same) throw std::out_of_range("settings are of another cell");
}

// The evaluated frames, which are to be those of the cell.
std::vector<CellFrame> FramesFromJson(const nlohmann::json& list, const Cell& cell) {
  std::vector<CellFrame> frames;
  std::vector<int> numbers;
  for (const nlohmann::json& entry : list) {
    CellFrame frame{FrameFromJson(entry.at("frame")), entry.at("examined"),
                    FromNamed(entry.at("scores"), EvaluationMetricCount()), entry.at("map_digest")};
    if (frame.examined != (frame.frame == cell.examined)) {
      throw std::out_of_range(fmt::format("frame {} is{} the examined one, expected {}",
                                          frame.frame, frame.examined ? "" : " not",
                                          cell.examined));
    }
    numbers.push_back(frame.frame);
    frames.push_back(std::move(frame));
  }
  if (numbers != cell.evaluated) {
    throw std::out_of_range(fmt::format("frames {} are evaluated, expected {}",
                                        fmt::join(numbers, " "), fmt::join(cell.evaluated, " ")));
  }
  return frames;
}

// Says the examined frame what the cell says of it?
void CheckExamined(const CellResult& result) {
  for (const CellFrame& frame : result.frames) {
    if (!frame.examined) continue;
    for (std::size_t m = 0; m < frame.values.size(); ++m) {
      const Measured& whole = result.examined[m];
      if (frame.values[m].value == whole.value && frame.values[m].why_not == whole.why_not)
        continue;
      throw std::out_of_range(fmt::format("{} is not what it is at frame {}, the examined one",
                                          SweepMetrics()[m].name, frame.frame));
    }
  }
}

// Of each frame used.
std::map<int, std::string> ImagesFromJson(const nlohmann::json& images, const Cell& cell) {
  if (images.size() != cell.frames.size()) {
    throw std::out_of_range(
        fmt::format("{} frames have images, expected {}", images.size(), cell.frames.size()));
  }
  std::map<int, std::string> digests;
  for (const int frame : cell.frames) digests[frame] = images.at(std::to_string(frame));
  return digests;
}

std::vector<double> FrameTimesFromJson(const nlohmann::json& list, const Cell& cell) {
  std::vector<double> times_ms = list.get<std::vector<double>>();
  if (times_ms.size() != cell.frames.size()) {
    throw std::out_of_range(
        fmt::format("{} frames have times, expected {}", times_ms.size(), cell.frames.size()));
  }
  for (const double ms : times_ms) {
    if (!(ms >= 0)) throw std::out_of_range(fmt::format("a frame's time is {}", ms));
  }
  return times_ms;
}

}  // namespace

int FrameFromJson(const nlohmann::json& value) {
  const auto frame = WholeIn(value, 0, std::numeric_limits<int>::max());
  if (!frame) throw std::out_of_range(fmt::format("{} is no frame", JsonShown(value)));
  return static_cast<int>(*frame);
}

InstanceId ObjectFromJson(const nlohmann::json& value) {
  const auto id = WholeIn(value, 0, kNoInstance);
  if (!id) throw std::out_of_range(fmt::format("{} is no object", JsonShown(value)));
  return static_cast<InstanceId>(*id);
}

Cell MakeCell(const CellSettings& settings, const SequenceVariant& variant,
              const std::string& program, const std::string& renderer) {
  const std::string frames =
      fmt::format("program {}\nrenderer {}\n{}", program, renderer, variant.Key());
  std::string key =
      fmt::format("tsdfpp cell {}\nmap {}\n{}", kCellSchema, MapKey(settings), frames);
  std::string id = HashText(key);
  return {settings,       std::move(key),    std::move(id),   HashText(frames),
          variant.frames, variant.evaluated, variant.examined};
}

std::string ImageDigest(const Frame& frame) {
  std::string bytes;
  Append(bytes, frame.depth);
  Append(bytes, frame.mask);
  Append(bytes, frame.colour);
  bytes += PoseToText(frame.T_WC);
  for (const auto& [id, T_WO] : frame.T_WO) bytes += fmt::format("{} {}", id, PoseToText(T_WO));
  return HashText(bytes);
}

std::string MeshDigest(const TriangleMesh& mesh) {
  std::string bytes;
  Append(bytes, mesh.vertices);
  Append(bytes, mesh.triangles);
  Append(bytes, mesh.colours);
  Append(bytes, mesh.face_ids);
  return HashText(bytes);
}

nlohmann::json CellToJson(const Cell& cell, const CellResult& result) {
  nlohmann::json frames = nlohmann::json::array();
  for (const CellFrame& frame : result.frames) {
    frames.push_back({{"frame", frame.frame},
                      {"examined", frame.examined},
                      {"scores", Named(frame.values)},
                      {"map_digest", frame.map_digest}});
  }
  nlohmann::json images = nlohmann::json::object();
  for (const auto& [frame, digest] : result.image_digests) images[std::to_string(frame)] = digest;
  return {
      {"schema", kCellSchema},
      {"id", cell.id},
      {"sequence", cell.sequence},
      {"key", cell.key},
      {"settings", SettingsJson(cell.settings)},
      {"examined", Named(result.examined)},
      {"removed", result.removed},
      {"frames", frames},
      {"evaluation", result.evaluation},
      {"times", {{"run", result.timed_in}, {"frame_ms", result.frame_ms}, {"steps", result.times}}},
      {"images", images}};
}

Expected<CellResult> CellFromJson(const std::string& text, const Cell& cell) {
  TSDFPP_ASSIGN(const nlohmann::json json, ParseJsonObject(text, "cell " + cell.id));
  try {
    if (json.at("schema") != kCellSchema || json.at("key") != cell.key) {
      return DataError("cell {}: is of another program or of other settings", cell.id);
    }
    if (json.at("id") != cell.id || json.at("sequence") != cell.sequence) {
      return DataError("cell {}: has the id {} and the sequence {}, expected its own", cell.id,
                       JsonShown(json.at("id")), JsonShown(json.at("sequence")));
    }
    CheckSettings(json.at("settings"), cell.settings);
    CellResult result;
    result.frames = FramesFromJson(json.at("frames"), cell);
    result.examined = FromNamed(json.at("examined"), SweepMetrics().size());
    CheckExamined(result);
    result.evaluation = json.at("evaluation");
    for (const nlohmann::json& id : json.at("removed"))
      result.removed.push_back(ObjectFromJson(id));
    const nlohmann::json& times = json.at("times");
    result.times = times.at("steps");
    result.frame_ms = FrameTimesFromJson(times.at("frame_ms"), cell);
    result.timed_in = times.at("run");
    result.image_digests = ImagesFromJson(json.at("images"), cell);
    return result;
  } catch (const std::exception& error) {
    return DataError("cell {}: a field is missing or wrong ({})", cell.id,
                     WithoutTag(error.what()));
  }
}

Expected<CellResult> CellStore::Read(const Cell& cell) const {
  TSDFPP_ASSIGN(const std::string text, ReadFile(PathOf(cell.id)));
  return CellFromJson(text, cell);
}

Expected<void> CellStore::Write(const Cell& cell, const CellResult& result) const {
  return WriteFile(PathOf(cell.id), JsonText(CellToJson(cell, result), 1) + "\n");
}

}  // namespace tsdfpp
