#include "sequence/sequence_json.h"

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "core/data_folder.h"
#include "core/files.h"
#include "core/one_line.h"
#include "core/plain_name.h"

namespace tsdfpp {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kSchemaVersion = 2;
constexpr int kOldestSchemaVersion = 1;
constexpr const char* kGenerator = "tsdfpp";

// nlohmann's own conversion would wrap a number that does not fit.
InstanceId IdOf(const Json& json) {
  const auto id = json.get<std::int64_t>();
  if (id < 0 || id >= kNoInstance) throw std::out_of_range(fmt::format("object id {}", id));
  return static_cast<InstanceId>(id);
}

Json ResidualJson(const Residual& residual) {
  return {{"mean_m", residual.mean_m},        {"p99_m", residual.p99_m},
          {"max_m", residual.max_m},          {"limit_m", residual.limit_m},
          {"checked", residual.checked},      {"excluded", residual.excluded},
          {"violations", residual.violations}};
}

Residual ResidualOf(const Json& json) {
  return {json.at("mean_m").get<double>(),          json.at("p99_m").get<double>(),
          json.at("max_m").get<double>(),           json.at("limit_m").get<double>(),
          json.at("checked").get<std::int64_t>(),   json.at("excluded").get<std::int64_t>(),
          json.at("violations").get<std::int64_t>()};
}

Json CertificateJson(const Certificate& certificate) {
  return {{"frames", certificate.frames},
          {"ray_frames", certificate.ray_frames},
          {"model", ResidualJson(certificate.model)},
          {"ray_depth", ResidualJson(certificate.ray_depth)},
          {"wrong_ids", certificate.wrong_ids}};
}

Certificate CertificateOf(const Json& json) {
  return {json.at("frames").get<int>(), json.at("ray_frames").get<int>(),
          ResidualOf(json.at("model")), ResidualOf(json.at("ray_depth")),
          json.at("wrong_ids").get<std::int64_t>()};
}

// `version` is the schema's.
SequenceRecord FromJson(const Json& json, int version) {
  SequenceRecord record;
  SequenceInfo& info = record.info;
  info.name = json.at("scene").get<std::string>();
  const Json& camera = json.at("intrinsics");
  info.intrinsics = {camera.at("width").get<int>(), camera.at("height").get<int>(),
                     camera.at("fx").get<double>(), camera.at("fy").get<double>(),
                     camera.at("cx").get<double>(), camera.at("cy").get<double>()};
  info.rate_hz = json.at("rate_hz").get<double>();
  info.first_index = json.at("first_index").get<int>();
  info.frame_count = json.at("frame_count").get<int>();
  for (const Json& object : json.at("objects")) {
    info.objects.push_back({IdOf(object.at("id")), object.at("name").get<std::string>(),
                            object.at("class").get<std::string>()});
  }
  if (const Json& reveal = json.at("reveal"); !reveal.is_null()) {
    info.reveal = RevealPlan{reveal.at("frame").get<int>(), {}};
    for (const Json& id : reveal.at("removed")) info.reveal->removed.push_back(IdOf(id));
  }
  GeneratorInfo& generator = record.generator;
  generator.version = json.at("version").get<std::string>();
  if (const Json& seed = json.at("seed"); !seed.is_null()) {
    generator.seed = seed.get<std::uint64_t>();
  }
  generator.sensor = json.at("sensor").get<std::string>();
  generator.backend = json.at("backend").get<std::string>();
  generator.renderer = json.at("renderer").get<std::string>();
  if (version >= 2) {
    if (const Json& certificate = json.at("certificate"); !certificate.is_null()) {
      record.certificate = CertificateOf(certificate);
    }
  }
  const Json& files = json.at("files");
  for (const auto& [file, hash] : files.at("fnv1a64").items()) {
    record.hashes.emplace(file, hash.get<std::string>());
  }
  return record;
}

}  // namespace

std::uint64_t Fnv1a64(std::string_view bytes) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char byte : bytes) {
    hash ^= static_cast<unsigned char>(byte);
    hash *= 0x100000001b3U;
  }
  return hash;
}

std::string HashText(std::string_view bytes) { return fmt::format("{:016x}", Fnv1a64(bytes)); }

std::string SequenceToJson(const SequenceRecord& record) {
  const SequenceInfo& info = record.info;
  const GeneratorInfo& generator = record.generator;
  Json json;
  json["schema_version"] = kSchemaVersion;
  json["generator"] = kGenerator;
  json["version"] = generator.version;
  json["scene"] = OneLine(info.name, kMostNameBytes);  // which the reader takes
  json["seed"] = generator.seed ? Json(*generator.seed) : Json(nullptr);
  json["intrinsics"] = {{"width", info.intrinsics.width}, {"height", info.intrinsics.height},
                        {"fx", info.intrinsics.fx},       {"fy", info.intrinsics.fy},
                        {"cx", info.intrinsics.cx},       {"cy", info.intrinsics.cy}};
  json["rate_hz"] = info.rate_hz;
  json["first_index"] = info.first_index;
  json["frame_count"] = info.frame_count;
  json["objects"] = Json::array();
  for (const ObjectInfo& object : info.objects) {
    json["objects"].push_back(
        {{"id", object.id}, {"name", object.name}, {"class", object.semantic_class}});
  }
  json["reveal"] = nullptr;
  if (info.reveal) {
    json["reveal"] = {{"frame", info.reveal->frame}, {"removed", info.reveal->removed}};
  }
  json["sensor"] = generator.sensor;
  json["backend"] = generator.backend;
  json["renderer"] = generator.renderer;
  json["certificate"] = record.certificate ? CertificateJson(*record.certificate) : Json(nullptr);
  Json hashes = Json::object();
  for (const auto& [file, hash] : record.hashes) hashes[file] = hash;
  json["files"]["fnv1a64"] = std::move(hashes);
  // Names may come from anywhere: bytes that are not UTF-8 are replaced rather than thrown at us.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Expected<SequenceRecord> ReadSequenceJson(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path));
  const std::string file = path.string();
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return DataError("{}: not a JSON object", file);
  if (!json.contains("generator") || json["generator"] != kGenerator) {
    return DataError("{}: 'generator' is not \"{}\"", file, kGenerator);
  }
  const Json version = json.value("schema_version", Json(nullptr));
  if (!version.is_number_integer() || version < kOldestSchemaVersion || version > kSchemaVersion) {
    return DataError("{}: 'schema_version' is {}, this program reads {} to {}", file,
                     version.is_null() ? "missing" : version.dump(), kOldestSchemaVersion,
                     kSchemaVersion);
  }
  try {
    SequenceRecord record = FromJson(json, version.get<int>());
    if (!(record.info.rate_hz > 0) || record.info.frame_count < 1 || record.info.first_index < 0) {
      return DataError("{}: expected rate_hz and frame_count over 0 and first_index 0 or more",
                       file);
    }
    TSDFPP_RETURN_IF_ERROR(CheckLabel(record.info.name, file + ": 'scene'"));
    TSDFPP_RETURN_IF_ERROR(CheckObjects(record.info.objects, file));
    for (const auto& [listed, hash] : record.hashes) {
      TSDFPP_RETURN_IF_ERROR(CheckRelativePath(listed, file + ": 'fnv1a64'"));
    }
    return record;
  } catch (const std::exception& exception) {
    return DataError("{}: a field is missing or of another type ({})", file, exception.what());
  }
}

bool IsOurSequence(const std::filesystem::path& folder) {
  std::error_code code;
  return std::filesystem::exists(folder / "sequence.json", code);
}

}  // namespace tsdfpp
