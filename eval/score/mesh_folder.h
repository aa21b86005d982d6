// The meshes that some mapper wrote, in the layout of docs/evaluate.md.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "eval/score/evaluation.h"

namespace tsdfpp {

// A part of a scene that the files tell apart: by an object's name, or by a label.
struct ScenePart {
  std::string source;           // for people: "truck-1.ply", "scene.ply, object_id 3"
  std::string name;             // what the file calls it; may be empty
  InstanceId id = kNoInstance;  // the label in the file, kNoInstance where there is none
};

struct LoadedScene {
  std::string source;  // for people: the file's name, or the folder's where there are several
  // Face ids are indices into `parts`; none where nothing is told apart.
  TriangleMesh mesh;
  std::vector<ScenePart> parts;
};

struct FrameMeshes {
  LoadedScene scene;
  // The scene after these objects of the sequence were really removed from the map.
  std::map<std::set<InstanceId>, LoadedScene> without;
  std::vector<std::string> remarks;  // sentences on what was left out
};

// Reads what is there for `frame`: from the subfolder whose name is that number ("256", "000256",
// "frame-000256"), or, where there is none and `alone` is set, from `folder` itself. There:
// - scene.<ending>: the visible scene; told apart by object_id a face (PLY) or by nodes (GLB);
// - or any other meshes, one an object, which together are the scene. A single one whose name is
//   not `<word>-<number>` is a scene that is not told apart;
// - scene-without-<id>[-<id>...].<ending>: the scene after a removal.
// Endings: IsSurfaceFile. Positions times `scale` are metres in the sequence's world.
// Errors: kUsage where there is no such folder; kData, naming the file, where there is no mesh for
// the frame, two folders are of it, a file cannot be read, or nothing has a face with an area.
Expected<FrameMeshes> ReadMeshFolder(const std::filesystem::path& folder, int frame, bool alone,
                                     double scale);

// Writes the scene and what is left after each removal as PLY into the subfolder of `frame`.
// Errors: kEnvironment.
Expected<void> WriteMeshFolder(const SceneMeshes& meshes, const std::filesystem::path& folder,
                               int frame);

// "truck", 1 of "truck-1"; only the name where there is no number behind a dash.
ScenePart PartOfName(const std::string& stem);

}  // namespace tsdfpp
