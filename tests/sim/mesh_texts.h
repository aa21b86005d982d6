// A folder of small mesh files, and the cube and the tetrahedron as text and bytes.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "core/files.h"
#include "sim/models/mesh_import.h"
#include "sim/models/mesh_shapes.h"

namespace tsdfpp {

// A folder of its own for each test, removed afterwards.
class MeshFolder : public testing::Test {
 protected:
  MeshFolder()
      : folder_(std::filesystem::path(testing::TempDir()) /
                fmt::format("tsdfpp_meshes_{}_{}", getpid(),
                            testing::UnitTest::GetInstance()->current_test_info()->name())) {
    std::filesystem::create_directories(folder_);
  }
  ~MeshFolder() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path Write(const std::string& name, const std::string& bytes) const {
    EXPECT_TRUE(WriteFile(folder_ / name, bytes).has_value());
    return folder_ / name;
  }

  ImportedMesh Import(const std::filesystem::path& path, double scale = 1,
                      const std::filesystem::path& picture = {}) const {
    auto mesh = ImportMesh(path, scale, picture);
    EXPECT_TRUE(mesh.has_value()) << mesh.error().message;
    return mesh.has_value() ? std::move(*mesh) : ImportedMesh{{ModelPart{}}, {}};
  }

  // The first remark that has these words in it.
  static bool Remarks(const MeshReport& report, const std::string& words) {
    return std::any_of(
        report.remarks.begin(), report.remarks.end(),
        [&](const std::string& remark) { return remark.find(words) != std::string::npos; });
  }

  std::filesystem::path folder_;
};

// The unit cube's corners, as OBJ.
inline constexpr const char* kCorners =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n";
inline constexpr const char* kQuads =
    "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
inline const std::string kCube = std::string(kCorners) + kQuads;

// The unit cube as a list of triangles.
inline std::vector<std::array<Eigen::Vector3d, 3>> CubeTriangles() {
  const Shape box = MakeBox({0, 0, 0}, {1, 1, 1}, 2);
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;
  for (const auto& [a, b, c] : box.triangles) {
    triangles.push_back({box.vertices[a], box.vertices[b], box.vertices[c]});
  }
  return triangles;
}

template <typename T>
void Append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

inline std::string BinaryStl(const std::string& header, std::uint32_t count) {
  std::string bytes = header + std::string(80 - header.size(), ' ');
  Append(bytes, count);
  for (const auto& triangle : CubeTriangles()) {
    for (int k = 0; k < 3; ++k) Append(bytes, 0.0F);
    for (const Eigen::Vector3d& p : triangle) {
      for (int k = 0; k < 3; ++k) Append(bytes, static_cast<float>(p[k]));
    }
    Append(bytes, std::uint16_t{0});
  }
  return bytes;
}

inline std::string AsciiStl() {
  std::string text = "solid a cube\n";
  for (const auto& triangle : CubeTriangles()) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (const Eigen::Vector3d& p : triangle) {
      text += fmt::format("  vertex {} {} {:e}\n", p.x(), p.y(), p.z());
    }
    text += " endloop\nendfacet\n";
  }
  return text + "endsolid a cube\n";
}

inline const std::string kPlyHeader =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
    "z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n";
inline const std::string kPlyVertices =
    "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n0 0 1 255 255 0\n";
inline const std::string kPlyFaces = "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

}  // namespace tsdfpp
