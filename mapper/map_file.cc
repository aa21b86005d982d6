#include "mapper/map_file.h"

#include <set>

#include "core/farthest.h"
#include "core/files.h"
#include "core/plain_name.h"
#include "mapper/map_persistence.h"
#include "mapper/store/section_file.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/lattice_range.h"

namespace tsdfpp {
namespace {

constexpr const char* kConfigSection = "CONF";
constexpr const char* kRunSection = "RUN ";

void PutText(std::string_view text, std::string& bytes) {
  PutBytes(static_cast<std::uint32_t>(text.size()), bytes);
  bytes += text;
}

std::string GetText(ByteReader& bytes) {
  const auto size = bytes.Get<std::uint32_t>();
  return std::string(bytes.Take(size));
}

void PutRecording(const MappedRecording& recording, std::string& bytes) {
  const Intrinsics& k = recording.intrinsics;
  for (const int size : {k.width, k.height}) PutBytes(static_cast<std::int32_t>(size), bytes);
  for (const double lens : {k.fx, k.fy, k.cx, k.cy}) PutBytes(lens, bytes);
  PutBytes(recording.last_depth, bytes);
  if (!recording.camera) return;
  SavePose(recording.camera->T_WC_given, bytes);
  SavePose(recording.camera->T_WC, bytes);
}

// Of a camera, which may be where no voxel can.
Pose GetAnyPose(ByteReader& bytes) {
  Pose T = Pose::Identity();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) T.matrix()(r, c) = bytes.Get<double>();
  }
  return T;
}

MappedRecording GetRecording(ByteReader& bytes) {
  MappedRecording recording;
  Intrinsics& k = recording.intrinsics;
  for (int* size : {&k.width, &k.height}) *size = bytes.Get<std::int32_t>();
  for (double* lens : {&k.fx, &k.fy, &k.cx, &k.cy}) *lens = bytes.Get<double>();
  recording.last_depth = bytes.Get<std::uint64_t>();
  if (!bytes.ok() || bytes.AtEnd()) return recording;
  recording.camera.emplace();
  recording.camera->T_WC_given = GetAnyPose(bytes);
  recording.camera->T_WC = GetAnyPose(bytes);
  return recording;
}

std::string RunToBytes(const MappedRun& run) {
  std::string bytes;
  PutText(run.sequence, bytes);
  PutText(run.poses, bytes);
  PutBytes(static_cast<std::int32_t>(run.last_frame), bytes);
  PutBytes(static_cast<std::uint32_t>(run.objects.size()), bytes);
  for (const ObjectInfo& object : run.objects) {
    PutBytes(object.id, bytes);
    PutText(object.name, bytes);
    PutText(object.semantic_class, bytes);
  }
  PutBytes(static_cast<std::uint32_t>(run.trajectories.size()), bytes);
  for (const auto& [id, poses] : run.trajectories) {
    PutBytes(id, bytes);
    PutBytes(static_cast<std::uint32_t>(poses.size()), bytes);
    for (const auto& [frame, T_WO] : poses) {
      PutBytes(static_cast<std::int32_t>(frame), bytes);
      SavePose(T_WO, bytes);
    }
  }
  // In files from before, these are absent: the first where ids are given.
  if (run.recording || run.associate != AssociationMode::kGiven) {
    PutText(AssociationModeName(run.associate), bytes);
  }
  if (run.recording) PutRecording(*run.recording, bytes);
  return bytes;
}

Expected<MappedRun> RunFromBytes(std::string_view all, const LatticeRange& range) {
  ByteReader bytes(all);
  MappedRun run;
  run.sequence = GetText(bytes);
  run.poses = GetText(bytes);
  run.last_frame = bytes.Get<std::int32_t>();
  const auto objects = bytes.Get<std::uint32_t>();
  for (std::uint32_t i = 0; i < objects && bytes.ok(); ++i) {
    ObjectInfo object;
    object.id = bytes.Get<InstanceId>();
    object.name = GetText(bytes);
    object.semantic_class = GetText(bytes);
    run.objects.push_back(std::move(object));
  }
  const auto trajectories = bytes.Get<std::uint32_t>();
  for (std::uint32_t i = 0; i < trajectories && bytes.ok(); ++i) {
    const auto id = bytes.Get<InstanceId>();
    if (run.trajectories.contains(id)) return DataError("object {} has two trajectories", id);
    auto& poses = run.trajectories[id];
    const auto count = bytes.Get<std::uint32_t>();
    for (std::uint32_t k = 0; k < count && bytes.ok(); ++k) {
      const auto frame = bytes.Get<std::int32_t>();
      if (!poses.empty() && frame <= poses.rbegin()->first) {
        return DataError("the trajectory of object {} has frame {} behind frame {}", id, frame,
                         poses.rbegin()->first);
      }
      TSDFPP_ASSIGN(poses[frame], LoadPose(bytes, range));
    }
  }
  if (bytes.ok() && !bytes.AtEnd()) {
    const auto associate = AssociationModeFromName(GetText(bytes));
    if (!associate) return DataError("it has another length than it says");
    run.associate = *associate;
  }
  if (bytes.ok() && !bytes.AtEnd()) run.recording = GetRecording(bytes);
  if (!bytes.AtEnd()) return DataError("it has another length than it says");
  return run;
}

Expected<void> CheckCameraPose(const Pose& T_WC) {
  TSDFPP_RETURN_IF_ERROR(CheckRigid(T_WC, "the camera's"));
  const double far_m = T_WC.translation().cwiseAbs().maxCoeff();
  if (far_m <= kFarthest_m) return {};
  return DataError("the camera is {:.6g} m from the origin along an axis, expected at most {:.6g}",
                   far_m, kFarthest_m);
}

// What is wrong with a run beside a map of these objects, as a fragment.
Expected<void> CheckRun(const MappedRun& run, const std::vector<InstanceId>& mapped) {
  TSDFPP_RETURN_IF_ERROR(CheckLabel(run.sequence, "the sequence's name"));
  if (!run.poses.empty()) TSDFPP_RETURN_IF_ERROR(CheckLabel(run.poses, "the source of poses"));
  TSDFPP_RETURN_IF_ERROR(CheckObjects(run.objects, "its list"));
  if (run.last_frame < -1 || run.last_frame > kGreatestSavedFrame) {
    return DataError("its last frame is {}, expected -1 to {}", run.last_frame,
                     kGreatestSavedFrame);
  }
  if (run.recording && run.recording->camera) {
    TSDFPP_RETURN_IF_ERROR(CheckCameraPose(run.recording->camera->T_WC_given));
    TSDFPP_RETURN_IF_ERROR(CheckCameraPose(run.recording->camera->T_WC));
  }
  std::set<InstanceId> listed;
  for (const ObjectInfo& object : run.objects) listed.insert(object.id);
  for (const InstanceId id : mapped) {
    if (!listed.contains(id)) return DataError("object {} of the map is not in its list", id);
  }
  for (const auto& [id, poses] : run.trajectories) {
    if (!listed.contains(id)) {
      return DataError("object {} has a trajectory and is not in its list", id);
    }
    if (!poses.empty() && poses.rbegin()->first > run.last_frame) {
      return DataError("the trajectory of object {} goes to frame {}, behind the last one, {}", id,
                       poses.rbegin()->first, run.last_frame);
    }
  }
  return {};
}

// The error of a part, whose message is a fragment, as one sentence.
Error InSection(const std::string& where, std::string_view section, const Error& error) {
  return {ErrorKind::kData,
          fmt::format("{}: section '{}' is wrong: {}", where, section, error.message)};
}

std::string NamesOf(const Sections& sections) {
  std::string names;
  for (const auto& [name, bytes] : sections) names += (names.empty() ? "" : " ") + name;
  return names;
}

struct Settings {
  Method method = Method::kTsdfpp;
  MapConfig config;
};

std::string SettingsToText(Method method, const MapConfig& config) {
  toml::table table = config.ToToml();
  table.insert("method", MethodName(method));
  return TomlText(table) + '\n';
}

Expected<Settings> SettingsFromText(const std::string& text) {
  Settings settings;
  TSDFPP_ASSIGN(toml::table table, ParseToml(text, "settings"));
  const auto method = table["method"].value<std::string>();
  if (!method) return DataError("no method is named");
  TSDFPP_ASSIGN(settings.method, MethodFromName(*method));
  table.erase("method");
  TSDFPP_ASSIGN(settings.config, MapConfig::FromToml(table, "settings"));
  return settings;
}

}  // namespace

Expected<void> CheckCanBeSaved(const MapRepresentation& map) {
  if (map.persistence() != nullptr) return {};
  return UsageError("a map of method '{}' cannot be saved", MethodName(map.method()));
}

Expected<std::string> MapToBytes(const MapRepresentation& map, const MappedRun* run) {
  TSDFPP_RETURN_IF_ERROR(CheckCanBeSaved(map));
  Sections sections;
  sections[kConfigSection] = SettingsToText(map.method(), map.config());
  if (run != nullptr) sections[kRunSection] = RunToBytes(*run);
  map.persistence()->Save(sections);
  return PackSections(sections);
}

Expected<LoadedMap> MapFromBytes(std::string_view bytes, const std::string& where) {
  TSDFPP_ASSIGN(Sections sections, UnpackSections(bytes, where));
  const auto take = [&](const char* name) {
    const auto section = sections.find(name);
    if (section == sections.end()) return std::optional<std::string>();
    std::optional<std::string> content(std::move(section->second));
    sections.erase(section);
    return content;
  };
  LoadedMap loaded;
  const auto settings_text = take(kConfigSection);
  if (!settings_text) return DataError("{}: has no section '{}'", where, kConfigSection);
  const auto settings = SettingsFromText(*settings_text);
  if (!settings) return tl::unexpected(InSection(where, kConfigSection, settings.error()));
  if (const auto run_bytes = take(kRunSection)) {
    auto run = RunFromBytes(*run_bytes, LatticeRange(settings->config.voxel_m));
    if (!run) return tl::unexpected(InSection(where, kRunSection, run.error()));
    loaded.run = std::move(*run);
  }
  loaded.map = MakeMap(settings->method, settings->config);
  MapPersistence* persistence = loaded.map->persistence();
  if (persistence == nullptr) {
    return DataError("{}: its map is of method '{}', which is not kept in files", where,
                     MethodName(settings->method));
  }
  Sections expected;
  persistence->Save(expected);
  if (NamesOf(sections) != NamesOf(expected)) {
    return DataError("{}: has sections '{}', expected '{}' for a map of method {}", where,
                     NamesOf(sections), NamesOf(expected), MethodName(settings->method));
  }
  if (auto status = persistence->Load(sections); !status) {
    return DataError("{}: its map is wrong: {}", where, status.error().message);
  }
  if (loaded.run) {
    if (const auto fits = CheckRun(*loaded.run, loaded.map->Objects()); !fits) {
      return tl::unexpected(InSection(where, kRunSection, fits.error()));
    }
  }
  return loaded;
}

Expected<void> SaveMap(const std::filesystem::path& path, const MapRepresentation& map,
                       const MappedRun* run) {
  TSDFPP_RETURN_IF_ERROR(CheckCanBeSaved(map));
  if (run != nullptr) {
    if (const auto fits = CheckRun(*run, map.Objects()); !fits) {
      return UsageError("{}: is not written, as nobody could load it: of its run {}", path.string(),
                        fits.error().message);
    }
  }
  TSDFPP_ASSIGN(const std::string bytes, MapToBytes(map, run));
  return WriteFile(path, bytes);
}

Expected<LoadedMap> LoadMap(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
  return MapFromBytes(bytes, path.string());
}

}  // namespace tsdfpp
