// Where a Co-Fusion set keeps its files (docs/sources.md, "Co-Fusion").
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/types.h"

namespace tsdfpp::cofusion {

inline constexpr const char* kCalibration = "calibration.txt";
inline constexpr const char* kColour = "colour";
inline constexpr const char* kDepth = "depth_original";
inline constexpr const char* kMask = "mask_id";
inline constexpr const char* kTrajectories = "trajectories";
inline constexpr const char* kCameraTrajectory = "trajectories/gt-cam-0.txt";
inline constexpr const char* kModels = "models";           // ours
inline constexpr const char* kSequence = "sequence.json";  // ours
// Ours: the scene that was rendered, and the truth on what can be seen of it.
inline constexpr const char* kScene = "scene.toml";
inline constexpr const char* kVisibility = "truth/visibility.csv";
// What a sensor with faults gave, beside the truth in depth_original, mask_id and gt-cam-0.
inline constexpr const char* kSensedDepth = "depth_noise";
inline constexpr const char* kSensedMask = "mask_noise";
inline constexpr const char* kSensedCameraTrajectory = "trajectories/sensed-cam-0.txt";
inline constexpr InstanceId kMaxId = 255;  // masks are 8-bit

// Paths relative to the set's folder, e.g. "colour/Color0001.png".
std::string ColourFile(int index);
std::string DepthFile(int index);
std::string MaskFile(int index);
std::string SensedDepthFile(int index);
std::string SensedMaskFile(int index);
std::string TrajectoryFile(const ObjectInfo& object);  // "trajectories/gt-<name>-<id>.txt"
std::string ModelFile(const ObjectInfo& object);       // "models/<name>-<id>.ply"

// The number of a file "<prefix><digits><suffix>", or nothing where the name is another.
std::optional<int> NumberOf(const std::string& file_name, const std::string& prefix,
                            const std::string& suffix);

// Name and id of a file "<prefix><name>-<id><suffix>" (a name may hold dashes), or nothing.
std::optional<ObjectInfo> ObjectOf(const std::string& file_name, const std::string& prefix,
                                   const std::string& suffix);

// Is this a folder that looks like a Co-Fusion set: calibration.txt beside colour/?
bool IsCofusion(const std::filesystem::path& folder);

}  // namespace tsdfpp::cofusion
