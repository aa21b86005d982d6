#include "eval/sweep/cell.h"

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

std::vector<Measured> FromNamed(const nlohmann::json& named, std::size_t count) {
  std::vector<Measured> values;
  for (std::size_t i = 0; i < count; ++i) {
    const nlohmann::json& value = named.at(SweepMetrics()[i].name);
    values.push_back(value.is_number() ? Measured::Of(value.get<double>())
                                       : Measured::Undefined(value.at("why")));
  }
  return values;
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
  return {settings, std::move(key), std::move(id), HashText(frames)};
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
    CellResult result;
    for (const nlohmann::json& entry : json.at("frames")) {
      result.frames.push_back({FrameFromJson(entry.at("frame")), entry.at("examined"),
                               FromNamed(entry.at("scores"), EvaluationMetricCount()),
                               entry.at("map_digest")});
    }
    result.examined = FromNamed(json.at("examined"), SweepMetrics().size());
    result.evaluation = json.at("evaluation");
    for (const nlohmann::json& id : json.at("removed"))
      result.removed.push_back(ObjectFromJson(id));
    const nlohmann::json& times = json.at("times");
    result.times = times.at("steps");
    result.frame_ms = times.at("frame_ms").get<std::vector<double>>();
    result.timed_in = times.at("run");
    for (const auto& [frame, digest] : json.at("images").items()) {
      result.image_digests[std::stoi(frame)] = digest;
    }
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
