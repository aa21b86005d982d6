// The materials of an OBJ file, and the libraries (.mtl) that it takes them from.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/data_folder.h"
#include "core/types.h"
#include "sim/models/mesh_files.h"

namespace tsdfpp {

// Shares from 0 to `full` as a colour; what is beyond is cut.
Colour ToColour(const Eigen::Vector3d& rgb, double full);

class ObjMaterials {
 public:
  // `mesh`, which must outlive it, gets the materials, the files that are named, and remarks on
  // what is left out.
  ObjMaterials(const std::filesystem::path& obj, Materials wanted, RawMesh& mesh);

  // The index of the material, which is new where no line named it before.
  int Named(const std::string& name);

  // Takes colours and pictures from a library, unless it was read before or none are wanted. One
  // that cannot be read is a remark.
  void ReadLibrary(const std::string& name);

 private:
  Companion Find(const std::filesystem::path& from, const std::string& name) const;
  std::optional<std::string> TextOf(const Companion& library, const std::string& name);
  void ReadColour(const std::vector<std::string_view>& words, const std::filesystem::path& library,
                  RawMaterial& material);
  void ReadPicture(std::string name, const std::filesystem::path& library,
                   const std::filesystem::path& from, RawMaterial& material);

  std::filesystem::path path_;
  std::string file_;  // for messages
  Materials wanted_;
  DataFolder above_;  // of the mesh's folder
  RawMesh& mesh_;
  std::map<std::string, int> materials_;
  std::set<std::filesystem::path> libraries_;  // read, or found to be unreadable
  std::int64_t library_bytes_ = 0;
};

}  // namespace tsdfpp
