#include "eval/score/mesh_folder.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <vector>

#include "core/data_folder.h"
#include "core/folders.h"
#include "core/ply.h"
#include "eval/score/surface_file.h"
#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScene = "scene";
constexpr const char* kWithout = "scene-without-";

std::optional<int> WholeNumber(std::string_view text) {
  int number = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (status != std::errc() || end != text.data() + text.size() || number < 0) return std::nullopt;
  return number;
}

// The frame of a subfolder "256", "000256", "frame256", "frame-000256".
std::optional<int> FrameOfFolder(std::string name) {
  for (const char* prefix : {"frame", "-", "_"}) {
    if (name.starts_with(prefix)) name = name.substr(std::string_view(prefix).size());
  }
  return WholeNumber(name);
}

Expected<fs::path> FolderOf(const fs::path& folder, int frame, bool alone) {
  std::error_code failure;
  if (!fs::is_directory(folder, failure)) {
    return UsageError("--meshes {}: no such folder", folder.string());
  }
  bool has_frames = false;
  std::vector<fs::path> found;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    std::error_code ignored;
    if (!entry->is_directory(ignored)) continue;
    const auto number = FrameOfFolder(entry->path().filename().string());
    if (number == frame) found.push_back(entry->path());
    has_frames = has_frames || number.has_value();
  }
  if (failure) return DataError("{}: cannot be read as a folder", folder.string());
  if (found.size() > 1) {
    std::sort(found.begin(), found.end());
    return DataError("{} and {} are both of frame {}", found[0].string(), found[1].string(), frame);
  }
  if (!found.empty()) return found.front();
  if (alone && !has_frames) return folder;
  return DataError("{}: holds nothing for frame {}, expected a subfolder {:06d} with its meshes",
                   folder.string(), frame, frame);
}

// "1-2" as ids.
std::optional<std::set<InstanceId>> IdsOf(std::string_view text) {
  std::set<InstanceId> ids;
  while (true) {
    const std::size_t dash = text.find('-');
    const auto id = WholeNumber(text.substr(0, dash));
    if (!id || *id >= kNoInstance) return std::nullopt;
    ids.insert(static_cast<InstanceId>(*id));
    if (dash == std::string_view::npos) return ids;
    text.remove_prefix(dash + 1);
  }
}

// Gives the faces of `mesh` the indices of parts of `scene`: one a label where it has labels, else
// one for all of it, named as `whole` says.
void AddPart(TriangleMesh mesh, const ScenePart& whole, LoadedScene& scene) {
  std::map<InstanceId, InstanceId> part_of_label;
  if (mesh.face_ids.empty()) {
    mesh.face_ids.assign(mesh.triangles.size(), static_cast<InstanceId>(scene.parts.size()));
    scene.parts.push_back(whole);
  } else {
    for (const InstanceId label : mesh.face_ids) part_of_label.try_emplace(label, 0);
    for (auto& [label, part] : part_of_label) {
      part = static_cast<InstanceId>(scene.parts.size());
      scene.parts.push_back({fmt::format("{}, object_id {}", whole.source, label), "", label});
    }
    for (InstanceId& label : mesh.face_ids) label = part_of_label.at(label);
  }
  AppendMesh(mesh, scene.mesh);
}

// One file. `scene_file`: it holds a scene, whatever its name.
Expected<void> AddFile(const fs::path& path, bool scene_file, double scale, LoadedScene& scene,
                       std::vector<std::string>& remarks) {
  TSDFPP_ASSIGN(std::vector<NamedMesh> parts, ReadSurfaceParts(path, scale, remarks));
  const std::string file = path.filename().string();
  for (NamedMesh& part : parts) {
    if (part.mesh.triangles.empty()) {
      remarks.push_back(fmt::format("{} has {} and no faces: it is left out", file,
                                    part.mesh.vertices.empty() ? "no vertices" : "points"));
      continue;
    }
    const bool node = !part.name.empty() || part.id != kNoInstance;
    if (node) {
      ScenePart whole = PartOfName(part.name);
      if (part.id != kNoInstance) whole.id = part.id;
      whole.source = fmt::format("{}, node '{}'", file, part.name);
      AddPart(std::move(part.mesh), whole, scene);
    } else if (!scene_file || !part.mesh.face_ids.empty()) {
      ScenePart whole = PartOfName(path.stem().string());
      whole.source = file;
      // What a file of one object is called counts, not the labels in it.
      if (!scene_file) part.mesh.face_ids.clear();
      AddPart(std::move(part.mesh), whole, scene);
    } else {
      AppendMesh(part.mesh, scene.mesh);
    }
  }
  return {};
}

Expected<void> CheckArea(const LoadedScene& scene) {
  if (scene.mesh.triangles.empty()) {
    return DataError("{}: has no faces, expected a mesh", scene.source);
  }
  if (!(SurfaceArea(scene.mesh) > 0)) {
    return DataError("{}: has {} faces but none of them has an area", scene.source,
                     scene.mesh.triangles.size());
  }
  constexpr std::size_t kMostParts = kNoInstance;
  if (scene.parts.size() >= kMostParts) {
    return DataError("{}: has {} objects, expected fewer than {}", scene.source, scene.parts.size(),
                     kMostParts);
  }
  return {};
}

}  // namespace

ScenePart PartOfName(const std::string& stem) {
  ScenePart part;
  part.name = stem;
  const std::size_t dash = stem.rfind('-');
  if (dash == std::string::npos || dash == 0) return part;
  const auto id = WholeNumber(std::string_view(stem).substr(dash + 1));
  if (!id || *id >= kNoInstance) return part;
  part.name = stem.substr(0, dash);
  part.id = static_cast<InstanceId>(*id);
  return part;
}

namespace {

// The surface files of a folder.
struct FoundFiles {
  std::vector<fs::path> scenes;  // named so
  std::vector<fs::path> others;  // sorted
  std::map<std::set<InstanceId>, fs::path> removals;
};

Expected<void> AddRemoval(const fs::path& path, FoundFiles& found) {
  const std::string stem = path.stem().string();
  const auto ids = IdsOf(std::string_view(stem).substr(std::string_view(kWithout).size()));
  if (!ids) {
    return DataError("{}: expected ids between dashes behind '{}', as in scene-without-1-2.ply",
                     path.string(), kWithout);
  }
  if (!found.removals.emplace(*ids, path).second) {
    return DataError("{}: a second scene without the same objects", path.string());
  }
  return {};
}

Expected<FoundFiles> FindFiles(const fs::path& folder, int frame) {
  FoundFiles found;
  std::error_code failure;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const fs::path& path = entry->path();
    if (!IsSurfaceFile(path) || IsFolder(path)) continue;
    const std::string stem = path.stem().string();
    if (stem == kScene) {
      found.scenes.push_back(path);
    } else if (stem.starts_with(kWithout)) {
      TSDFPP_RETURN_IF_ERROR(AddRemoval(path, found));
    } else {
      found.others.push_back(path);
    }
  }
  if (failure) return DataError("{}: cannot be read as a folder", folder.string());
  std::sort(found.others.begin(), found.others.end());
  if (found.scenes.size() > 1) {
    return DataError("{}: holds {} and {}, expected one scene", folder.string(),
                     found.scenes[0].filename().string(), found.scenes[1].filename().string());
  }
  if (found.scenes.empty() && found.others.empty()) {
    return DataError("{}: holds no mesh of frame {} (.ply, .obj, .stl, .glb)", folder.string(),
                     frame);
  }
  return found;
}

}  // namespace

Expected<FrameMeshes> ReadMeshFolder(const fs::path& given, int frame, bool alone, double scale) {
  TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(given));
  TSDFPP_ASSIGN(const fs::path folder, FolderOf(given, frame, alone));
  TSDFPP_ASSIGN(const FoundFiles found, FindFiles(folder, frame));
  const std::vector<fs::path>& scenes = found.scenes;
  const std::vector<fs::path>& others = found.others;

  FrameMeshes out;
  if (!scenes.empty()) {
    out.scene.source = scenes[0].string();
    TSDFPP_RETURN_IF_ERROR(AddFile(scenes[0], true, scale, out.scene, out.remarks));
    if (!others.empty()) {
      out.remarks.push_back(fmt::format("{}: {} is scored; {} other meshes beside it are left out",
                                        folder.string(), scenes[0].filename().string(),
                                        others.size()));
    }
  } else if (others.size() == 1 && PartOfName(others[0].stem().string()).id == kNoInstance) {
    out.scene.source = others[0].string();
    TSDFPP_RETURN_IF_ERROR(AddFile(others[0], true, scale, out.scene, out.remarks));
  } else {
    out.scene.source = folder.string();
    for (const fs::path& path : others) {
      TSDFPP_RETURN_IF_ERROR(AddFile(path, false, scale, out.scene, out.remarks));
    }
  }
  TSDFPP_RETURN_IF_ERROR(CheckArea(out.scene));
  for (const auto& [ids, path] : found.removals) {
    LoadedScene& without = out.without[ids];
    without.source = path.string();
    // Nothing may be left after a removal.
    TSDFPP_RETURN_IF_ERROR(AddFile(path, true, scale, without, out.remarks));
  }
  return out;
}

Expected<void> WriteMeshFolder(const SceneMeshes& meshes, const fs::path& folder, int frame) {
  const fs::path here = folder / fmt::format("{:06d}", frame);
  TSDFPP_RETURN_IF_ERROR(WritePly(here / "scene.ply", meshes.scene));
  for (const auto& [removed, mesh] : meshes.without) {
    TSDFPP_RETURN_IF_ERROR(
        WritePly(here / fmt::format("{}{}.ply", kWithout, fmt::join(removed, "-")), mesh));
  }
  return {};
}

}  // namespace tsdfpp
