#include "sim/models/obj_materials.h"

#include <algorithm>

#include "core/files.h"
#include "core/one_line.h"
#include "sim/models/text_scanner.h"

namespace tsdfpp {
namespace {

// Stands for the name of the mesh's folder in a path from the folder above it.
constexpr const char* kMeshFolder = "\x01";

}  // namespace

Colour ToColour(const Eigen::Vector3d& rgb, double full) {
  Colour colour{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double share = std::clamp(rgb[static_cast<Eigen::Index>(k)] / full, 0.0, 1.0);
    colour[k] = static_cast<std::uint8_t>(255 * share + 0.5);
  }
  return colour;
}

ObjMaterials::ObjMaterials(const std::filesystem::path& obj, Materials wanted, RawMesh& mesh)
    : path_(obj),
      file_(obj.string()),
      wanted_(wanted),
      above_(obj.parent_path() / ".."),
      mesh_(mesh) {}

int ObjMaterials::Named(const std::string& name) {
  const auto [entry, is_new] =
      materials_.try_emplace(name, static_cast<int>(mesh_.materials.size()));
  if (is_new) mesh_.materials.push_back({name, std::nullopt, {}});
  return entry->second;
}

// Where a path is that a file in the folder `from` (as seen from the folder above the mesh's) says.
Companion ObjMaterials::Find(const std::filesystem::path& from, const std::string& name) const {
  const std::filesystem::path seen = (from / name).lexically_normal();
  const std::filesystem::path folder = path_.parent_path();
  if (seen.is_absolute() || seen.begin() == seen.end() || *seen.begin() == "..") {
    return {name, folder / name, false};
  }
  const bool beside = *seen.begin() == kMeshFolder;
  const std::filesystem::path path =
      beside ? folder / seen.lexically_relative(kMeshFolder) : folder / ".." / seen;
  return {name, path, above_.CheckLinks(path).has_value()};
}

// The library's text, unless it cannot be read, which is a remark.
std::optional<std::string> ObjMaterials::TextOf(const Companion& library, const std::string& name) {
  auto bytes =
      library.inside
          ? ReadFile(library.path, &Limits::text_bytes)
          : DataError("{}: expected a relative path inside the folder above the mesh's", name);
  if (!bytes) {
    mesh_.remarks.push_back(
        fmt::format("{}: its material library cannot be read ({}), so its "
                    "colours are not known",
                    file_, bytes.error().message));
    return std::nullopt;
  }
  library_bytes_ += static_cast<std::int64_t>(bytes->size());
  if (library_bytes_ > CurrentLimits().text_bytes) {
    mesh_.remarks.push_back(
        fmt::format("{}: is left out, its material libraries are larger together than one may be",
                    library.path.string()));
    return std::nullopt;
  }
  return std::move(*bytes);
}

// Kd: the colour, three numbers from 0 to 1.
void ObjMaterials::ReadColour(const std::vector<std::string_view>& words,
                              const std::filesystem::path& library, RawMaterial& material) {
  Eigen::Vector3d rgb = Eigen::Vector3d::Constant(-1);
  for (int k = 0; k < 3; ++k) {
    rgb[k] = NumberIn<double>(words[static_cast<std::size_t>(k) + 1]).value_or(-1);
  }
  if (rgb.allFinite() && rgb.minCoeff() >= 0) {
    material.colour = ToColour(rgb, 1);
  } else {
    mesh_.remarks.push_back(
        fmt::format("{}: Kd of material '{}' is not three numbers from 0 to 1: left out",
                    library.string(), material.name));
  }
}

// map_Kd: the picture, where it is one that may be looked at; `from` is the library's folder.
void ObjMaterials::ReadPicture(std::string name, const std::filesystem::path& library,
                               const std::filesystem::path& from, RawMaterial& material) {
  std::replace(name.begin(), name.end(), '\\', '/');
  const Companion found = Find(from, name);
  mesh_.companions.push_back(found);
  if (found.inside) {
    material.picture = found.path;
  } else {
    mesh_.remarks.push_back(
        fmt::format("{}: the picture {} of material {} is not looked at, expected a relative "
                    "path inside the folder above the mesh's",
                    library.string(), Quoted(name), Quoted(material.name)));
  }
}

void ObjMaterials::ReadLibrary(const std::string& name) {
  if (wanted_ == Materials::kSkip) return;
  std::string plain = name;
  std::replace(plain.begin(), plain.end(), '\\', '/');
  const Companion library = Find(kMeshFolder, plain);
  // One library has many names: "a.mtl", "./a.mtl".
  std::error_code code;
  const std::filesystem::path place = std::filesystem::weakly_canonical(library.path, code);
  if (!libraries_.insert(code ? library.path : place).second) return;
  mesh_.companions.push_back(library);
  const std::optional<std::string> bytes = TextOf(library, plain);
  if (!bytes) return;
  const std::filesystem::path from =
      (std::filesystem::path(kMeshFolder) / plain).lexically_normal().parent_path();
  RawMaterial* material = nullptr;
  std::string_view text = *bytes;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    const auto words = WordsOf(line);
    if (words.size() < 2) continue;
    if (words[0] == "newmtl") {
      const int index = Named(RestOf(line, words[0]));
      material = &mesh_.materials[static_cast<std::size_t>(index)];
    } else if (words[0] == "Kd" && material != nullptr && words.size() >= 4) {
      ReadColour(words, library.path, *material);
    } else if (words[0] == "map_Kd" && material != nullptr) {
      // Options such as `-s 1 1 1` come before the name, which then cannot hold blanks.
      ReadPicture(words[1].starts_with('-') ? std::string(words.back()) : RestOf(line, words[0]),
                  library.path, from, *material);
    }
  }
}

}  // namespace tsdfpp
