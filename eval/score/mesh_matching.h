// Which object of the sequence each part of somebody's mesh is.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/score/mesh_folder.h"
#include "eval/truth/scene_truth.h"
#include "metrics/measured.h"

namespace tsdfpp {

enum class MatchMode {
  kNames,  // names and labels that the sequence has are taken; only the rest is matched by overlap
  kOverlap,  // names and labels are arbitrary: all is matched by overlap
};

// "names" or "overlap". Errors: kUsage.
Expected<MatchMode> MatchModeFromName(const std::string& name);

struct PartMatch {
  ScenePart part;
  InstanceId object = kNoInstance;  // kNoInstance: it is none of them
  std::string object_name;
  std::string how;  // "name", "label", "overlap" or "nothing"
  double area_m2 = 0;
  // Share of the part's area that is within kReachVoxels of a true surface and nearest to that of
  // `object`; of the object with the greatest share, where it is none.
  Measured share;
};

// A part without a name or label that the sequence has is the object to which the most of its area
// is nearest (and within reach), if that is kLeastShare of it. Several parts may be one object.
inline constexpr double kReachVoxels = 2;
inline constexpr double kLeastShare = 0.25;

struct MatchedScene {
  TriangleMesh mesh;  // face ids are the sequence's; empty where nothing is told apart
  std::vector<PartMatch> matches;
  std::vector<std::string> remarks;  // sentences on what looks wrong
};

// The true surfaces are those at the tracker's current frame. `objects` are those of the sequence.
// Remarks: nothing is within reach of the truth; most of what is faces the other way; a part lies
// on another object than its name says; an object has no part.
MatchedScene MatchScene(const LoadedScene& scene, const SceneTruth& truth,
                        const std::vector<ObjectInfo>& objects, double voxel_m, MatchMode mode);

// A scene after a removal. `matches` are those of the scene before it: parts of equal names and
// labels are the same objects; others, which were hidden before, are matched as by MatchScene().
// `remarks` gets what looks wrong.
TriangleMesh WithMatches(const LoadedScene& scene, const std::vector<PartMatch>& matches,
                         const SceneTruth& truth, const std::vector<ObjectInfo>& objects,
                         double voxel_m, MatchMode mode, std::vector<std::string>& remarks);

nlohmann::json ToJson(const std::vector<PartMatch>& matches);

}  // namespace tsdfpp
