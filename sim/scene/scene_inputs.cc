#include "sim/scene/scene_inputs.h"

#include <spdlog/spdlog.h>

#include <variant>
#include <vector>

#include "core/files.h"
#include "core/folders.h"
#include "core/toml_reader.h"
#include "sim/models/mesh_files.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr const char* kInputs = "inputs";

// Can JSON and TOML hold it?
bool IsText(const std::string& name) {
  return ParseToml("name = '''" + name + "'''", "name").has_value();
}

// The files that an OBJ refers to and that are there.
Expected<std::vector<Companion>> ReferredTo(const fs::path& mesh) {
  if (mesh.extension() != ".obj") return std::vector<Companion>();
  TSDFPP_ASSIGN(const std::string bytes, ReadFile(mesh));
  TSDFPP_ASSIGN(RawMesh raw, ReadObj(mesh, bytes));
  std::erase_if(raw.companions, [](const Companion& companion) {
    std::error_code code;
    return !fs::is_regular_file(companion.path, code);
  });
  return std::move(raw.companions);
}

// Those of them that can be taken along.
Expected<std::vector<fs::path>> Companions(const fs::path& mesh) {
  std::vector<fs::path> found;
  TSDFPP_ASSIGN(const std::vector<Companion> referred_to, ReferredTo(mesh));
  for (const Companion& companion : referred_to) {
    if (!companion.inside || !IsText(companion.name)) {
      spdlog::warn(
          "{}: refers to '{}', which a sequence cannot take along: the mesh lacks it; expected a "
          "relative path in UTF-8 inside the folder above the mesh's",
          mesh.string(), companion.name);
      continue;
    }
    found.push_back(companion.path.lexically_normal());
  }
  return found;
}

// The folder that holds all of the files, at whatever depth.
fs::path CommonFolder(const std::vector<fs::path>& files) {
  fs::path folder = files.front().parent_path();
  for (const fs::path& file : files) {
    const auto holds = [&] {
      const fs::path relative = file.lexically_relative(folder);
      return !relative.empty() && *relative.begin() != "..";
    };
    while (!holds() && folder.has_relative_path()) folder = folder.parent_path();
  }
  return folder;
}

class Collector {
 public:
  explicit Collector(const SceneConfig& config) { inputs_.config = config; }

  Expected<SceneInputs> Run() {
    if (auto* recorded = std::get_if<RecordedPath>(&inputs_.config.camera.path)) {
      TSDFPP_ASSIGN(recorded->file, Take(recorded->file));
    }
    for (SceneObject& object : inputs_.config.objects) {
      for (fs::path* file : {&object.model.file, &object.model.picture}) {
        if (file->empty()) continue;
        TSDFPP_ASSIGN(*file, Take(*file));
      }
    }
    return std::move(inputs_);
  }

 private:
  // Where the file will be.
  Expected<std::string> Take(const fs::path& named) {
    const fs::path file = AbsolutePath(named).lexically_normal();
    if (const auto taken = taken_.find(file); taken != taken_.end()) return taken->second;
    std::vector<fs::path> group{file};
    TSDFPP_ASSIGN(const std::vector<fs::path> companions, Companions(file));
    group.insert(group.end(), companions.begin(), companions.end());
    const fs::path from = CommonFolder(group);
    const fs::path to = fs::path(kInputs) / std::to_string(taken_.size() + 1);
    for (const fs::path& one : group) {
      inputs_.files.emplace((to / one.lexically_relative(from)).string(), one);
    }
    return taken_.emplace(file, (to / file.lexically_relative(from)).string()).first->second;
  }

  SceneInputs inputs_;
  std::map<fs::path, std::string> taken_;  // places by the file's own
};

}  // namespace

std::vector<fs::path> ListInputs(const SceneConfig& config) {
  std::vector<fs::path> files;
  if (const auto* recorded = std::get_if<RecordedPath>(&config.camera.path)) {
    files.emplace_back(recorded->file);
  }
  for (const SceneObject& object : config.objects) {
    for (const fs::path& file : {object.model.file, object.model.picture}) {
      if (file.empty()) continue;
      files.push_back(file);
      const auto companions = ReferredTo(file);
      if (!companions) continue;  // which is said where the mesh is read
      for (const Companion& companion : *companions) {
        if (companion.inside) files.push_back(companion.path);
      }
    }
  }
  return files;
}

Expected<SceneInputs> CollectInputs(const SceneConfig& config) { return Collector(config).Run(); }

}  // namespace tsdfpp
