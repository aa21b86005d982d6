#include "sequence/sequence_json.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "core/data_folder.h"
#include "core/files.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "core/plain_name.h"

namespace tsdfpp {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kSchemaVersion = 2;
constexpr int kOldestSchemaVersion = 1;
constexpr const char* kGenerator = "tsdfpp";
constexpr int kGreatestFrame = 1'000'000'000;  // what users of the numbers can add to
constexpr int kLeastSide_px = 2;
constexpr const char* kIdsOfObjects = "objects";
constexpr const char* kIdsOfAFrame = "frame";

// nlohmann's own conversion would wrap a number that does not fit. Throws as that does where the
// value is of another type.
template <typename T>
T WholeOf(const nlohmann::json& json, const char* what, std::int64_t lowest, std::int64_t highest) {
  const auto number = WholeIn(json, lowest, highest);
  if (!number) {
    throw std::out_of_range(fmt::format("{} is {}, expected a whole number from {} to {}", what,
                                        JsonShown(json), lowest, highest));
  }
  return static_cast<T>(*number);
}

InstanceId IdOf(const nlohmann::json& json) {
  return WholeOf<InstanceId>(json, "an object's id", 0, kNoInstance - 1);
}

std::int64_t CountOf(const nlohmann::json& json, const char* what) {
  return WholeOf<std::int64_t>(json, what, 0, std::numeric_limits<std::int64_t>::max());
}

Json ResidualJson(const Residual& residual) {
  return {{"mean_m", residual.mean_m},        {"p99_m", residual.p99_m},
          {"max_m", residual.max_m},          {"limit_m", residual.limit_m},
          {"checked", residual.checked},      {"excluded", residual.excluded},
          {"violations", residual.violations}};
}

Residual ResidualOf(const nlohmann::json& json) {
  return {json.at("mean_m").get<double>(),
          json.at("p99_m").get<double>(),
          json.at("max_m").get<double>(),
          json.at("limit_m").get<double>(),
          CountOf(json.at("checked"), "checked"),
          CountOf(json.at("excluded"), "excluded"),
          CountOf(json.at("violations"), "violations")};
}

Json CertificateJson(const Certificate& certificate) {
  return {{"frames", certificate.frames},
          {"ray_frames", certificate.ray_frames},
          {"model", ResidualJson(certificate.model)},
          {"ray_depth", ResidualJson(certificate.ray_depth)},
          {"wrong_ids", certificate.wrong_ids}};
}

Certificate CertificateOf(const nlohmann::json& json) {
  return {WholeOf<int>(json.at("frames"), "frames", 0, kGreatestFrame),
          WholeOf<int>(json.at("ray_frames"), "ray_frames", 0, kGreatestFrame),
          ResidualOf(json.at("model")), ResidualOf(json.at("ray_depth")),
          CountOf(json.at("wrong_ids"), "wrong_ids")};
}

// `version` is the schema's.
SequenceRecord FromJson(const nlohmann::json& json, int version) {
  SequenceRecord record;
  SequenceInfo& info = record.info;
  info.name = json.at("scene").get<std::string>();
  const nlohmann::json& camera = json.at("intrinsics");
  const std::int64_t most_side = CurrentLimits().image_side;
  info.intrinsics = {WholeOf<int>(camera.at("width"), "width", kLeastSide_px, most_side),
                     WholeOf<int>(camera.at("height"), "height", kLeastSide_px, most_side),
                     camera.at("fx").get<double>(),
                     camera.at("fy").get<double>(),
                     camera.at("cx").get<double>(),
                     camera.at("cy").get<double>()};
  info.rate_hz = json.at("rate_hz").get<double>();
  info.first_index = WholeOf<int>(json.at("first_index"), "first_index", -1, kGreatestFrame);
  info.frame_count = WholeOf<int>(json.at("frame_count"), "frame_count", 0, CurrentLimits().frames);
  for (const nlohmann::json& object : json.at("objects")) {
    info.objects.push_back({IdOf(object.at("id")), object.at("name").get<std::string>(),
                            object.at("class").get<std::string>()});
  }
  // Absent where masks name objects, and from files of before.
  if (const auto ids = json.find("mask_ids"); ids != json.end()) {
    const auto of = ids->get<std::string>();
    if (of != kIdsOfAFrame && of != kIdsOfObjects) {
      throw std::out_of_range(fmt::format("mask_ids is {}, expected {} or {}", JsonShown(*ids),
                                          kIdsOfObjects, kIdsOfAFrame));
    }
    info.mask_ids_are_objects = of == kIdsOfObjects;
  }
  if (const nlohmann::json& reveal = json.at("reveal"); !reveal.is_null()) {
    info.reveal =
        RevealPlan{WholeOf<int>(reveal.at("frame"), "the reveal's frame", 0, kGreatestFrame), {}};
    for (const nlohmann::json& id : reveal.at("removed")) info.reveal->removed.push_back(IdOf(id));
  }
  GeneratorInfo& generator = record.generator;
  generator.version = json.at("version").get<std::string>();
  if (const nlohmann::json& seed = json.at("seed"); !seed.is_null()) {
    if (!seed.is_number_unsigned()) throw std::out_of_range("seed is no whole number from 0");
    generator.seed = seed.get<std::uint64_t>();
  }
  generator.sensor = json.at("sensor").get<std::string>();
  generator.backend = json.at("backend").get<std::string>();
  generator.renderer = json.at("renderer").get<std::string>();
  if (version >= 2) {
    if (const nlohmann::json& certificate = json.at("certificate"); !certificate.is_null()) {
      record.certificate = CertificateOf(certificate);
    }
  }
  const nlohmann::json& files = json.at("files");
  for (const auto& [file, hash] : files.at("fnv1a64").items()) {
    record.hashes.emplace(file, hash.get<std::string>());
  }
  return record;
}

// Times of frames stay numbers that other formats can hold.
constexpr double kSlowest_hz = 1e-6;
constexpr double kFastest_hz = 1e9;

// What is to be removed is an object of the sequence, not its background, and is named once.
Expected<void> CheckReveal(const SequenceInfo& info, const std::string& file) {
  if (!info.reveal) return {};
  std::set<InstanceId> removed;
  for (const InstanceId id : info.reveal->removed) {
    const bool known = std::any_of(info.objects.begin(), info.objects.end(),
                                   [&](const ObjectInfo& object) { return object.id == id; });
    if (id == kBackground || !known || !removed.insert(id).second) {
      return DataError(
          "{}: 'reveal' removes object {}, expected objects of the sequence, each once", file, id);
    }
  }
  return {};
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
  if (!info.mask_ids_are_objects) json["mask_ids"] = kIdsOfAFrame;
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
  return JsonText(json, 2) + "\n";
}

Expected<SequenceRecord> ReadSequenceJson(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path, &Limits::json_bytes));
  const std::string file = path.string();
  TSDFPP_ASSIGN(const nlohmann::json json, ParseJsonObject(text, file));
  if (!json.contains("generator") || json["generator"] != kGenerator) {
    return DataError("{}: 'generator' is not \"{}\"", file, kGenerator);
  }
  const nlohmann::json version = json.value("schema_version", nlohmann::json(nullptr));
  if (!version.is_number_integer() || version < kOldestSchemaVersion || version > kSchemaVersion) {
    return DataError("{}: 'schema_version' is {}, this program reads {} to {}", file,
                     version.is_null() ? "missing" : JsonShown(version), kOldestSchemaVersion,
                     kSchemaVersion);
  }
  try {
    SequenceRecord record = FromJson(json, version.get<int>());
    if (record.info.frame_count < 1 || record.info.first_index < 0 ||
        !(record.info.rate_hz >= kSlowest_hz && record.info.rate_hz <= kFastest_hz)) {
      return DataError(
          "{}: expected a rate_hz of {:g} to {:g}, frame_count over 0 and first_index 0 or more",
          file, kSlowest_hz, kFastest_hz);
    }
    const Intrinsics& camera = record.info.intrinsics;
    if (!(camera.fx > 0) || !(camera.fy > 0) || !std::isfinite(camera.fx) ||
        !std::isfinite(camera.fy) || !std::isfinite(camera.cx) || !std::isfinite(camera.cy) ||
        !std::isfinite(record.info.rate_hz)) {
      return DataError("{}: expected finite intrinsics with fx and fy over 0, and a finite rate",
                       file);
    }
    TSDFPP_RETURN_IF_ERROR(CheckLabel(record.info.name, file + ": 'scene'"));
    TSDFPP_RETURN_IF_ERROR(CheckObjects(record.info.objects, file));
    TSDFPP_RETURN_IF_ERROR(CheckReveal(record.info, file));
    for (const auto& [listed, hash] : record.hashes) {
      TSDFPP_RETURN_IF_ERROR(CheckRelativePath(listed, file + ": 'fnv1a64'"));
    }
    return record;
  } catch (const std::exception& exception) {
    return DataError("{}: a field is missing or of another type ({})", file,
                     WithoutTag(exception.what()));
  }
}

bool IsOurSequence(const std::filesystem::path& folder) {
  std::error_code code;
  return std::filesystem::exists(folder / "sequence.json", code);
}

}  // namespace tsdfpp
