// A whole map in one file (docs/map.md, "The map file").
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/associate/associator.h"
#include "mapper/map_representation.h"
#include "mapper/track/camera_source.h"

namespace tsdfpp {

// The greatest number of a frame that a file's run has: one that its users can add to.
inline constexpr int kGreatestSavedFrame = 1'000'000'000;

// Of which recording a map is: what tells it from another of the same name.
struct MappedRecording {
  Intrinsics intrinsics;
  std::uint64_t last_depth = 0;       // a hash of the last frame's depth image
  std::optional<CameraPlace> camera;  // after the last frame, where poses were not taken as given
};

// What a run of the pipeline knows beside its map: needed to continue it, and to name the objects.
struct MappedRun {
  std::string sequence;             // its name
  std::vector<ObjectInfo> objects;  // of the sequence, or with votes of the map
  std::string poses;                // where they came from: PoseSourceName
  int last_frame = 0;               // the file number of the last frame in the map
  std::map<InstanceId, std::map<int, Pose>> trajectories;  // T_WO by frame, as the map had it
  AssociationMode associate = AssociationMode::kGiven;     // whose ids the map's are
  std::optional<MappedRecording> recording;                // nothing in files from before
};

struct LoadedMap {
  std::unique_ptr<MapRepresentation> map;
  std::optional<MappedRun> run;
};

// Whether the map can be saved. Errors: kUsage, a sentence, where its method writes no files.
Expected<void> CheckCanBeSaved(const MapRepresentation& map);

// The file's bytes: the same for maps that are equal, whatever their past and the number of
// threads. Errors: those of CheckCanBeSaved.
Expected<std::string> MapToBytes(const MapRepresentation& map, const MappedRun* run = nullptr);

// `where` names the file in errors, which are kData and one sentence: a foreign, newer, truncated
// or damaged file, one whose content no map can have, or whose names cannot be shown or be
// those of files, lack an object of the map or of a trajectory, or are there twice
// (core/plain_name.h). The loaded map is the saved one: whatever happens to both, they stay equal,
// bit for bit.
Expected<LoadedMap> MapFromBytes(std::string_view bytes, const std::string& where);

// The file appears whole or not at all. Errors: kEnvironment where the disk refuses; those of
// CheckCanBeSaved; kUsage where LoadMap would refuse what the run says.
Expected<void> SaveMap(const std::filesystem::path& path, const MapRepresentation& map,
                       const MappedRun* run = nullptr);

// Errors: kData; those of MapFromBytes, or a missing file.
Expected<LoadedMap> LoadMap(const std::filesystem::path& path);

}  // namespace tsdfpp
