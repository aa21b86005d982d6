// What an OBJ's materials and pictures may lead to.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "core/files.h"
#include "sim/models/mesh_files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";

class ObjPaths : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* place : {"top/mesh/near.mtl", "top/looks/beside.mtl", "top/mesh/sub/below.mtl",
                              "top/above.mtl", "far/secret.mtl"}) {
      ASSERT_TRUE(WriteFile(folder_ / place, "newmtl red\nKd 1 0 0\n").has_value());
    }
  }
  RawMesh Read(const std::string& library, Materials materials = Materials::kRead) const {
    const auto mesh =
        ReadObj(folder_ / "top/mesh/x.obj", "mtllib " + library + "\n" + kTriangle, materials);
    EXPECT_TRUE(mesh.has_value()) << mesh.error().message;
    return *mesh;
  }
  bool IsRed(const std::string& library) const {
    const RawMesh mesh = Read(library);
    return mesh.materials.size() == 1 && mesh.materials[0].colour.has_value();
  }
  const test::TempFolder folder_;
};

TEST_F(ObjPaths, InsideTheFolderAboveTheMeshsOwn) {
  for (const char* library :
       {"near.mtl", "./near.mtl", "sub/below.mtl", "sub/../near.mtl", "../looks/beside.mtl",
        "..\\looks\\beside.mtl", "../above.mtl", "../mesh/near.mtl"}) {
    EXPECT_TRUE(IsRed(library)) << library;
  }
}

TEST_F(ObjPaths, NoneOutsideIsRead) {
  fs::create_symlink(folder_ / "far/secret.mtl", folder_ / "top/mesh/link.mtl");
  fs::create_directory_symlink(folder_ / "far", folder_ / "top/linked");
  ASSERT_EQ(mkfifo((folder_ / "top/mesh/pipe.mtl").c_str(), 0600), 0);
  for (const std::string& library :
       {std::string("../../far/secret.mtl"), (folder_ / "far/secret.mtl").string(),
        std::string("/dev/zero"), std::string("link.mtl"), std::string("../linked/secret.mtl"),
        std::string("sub/../../../far/secret.mtl"), std::string("pipe.mtl"), std::string(".."),
        std::string(".")}) {
    const RawMesh mesh = Read(library);
    EXPECT_EQ(mesh.remarks.size(), 1U) << library;
    ASSERT_EQ(mesh.materials.size(), 1U);
    EXPECT_FALSE(mesh.materials[0].colour.has_value()) << library;
  }
  EXPECT_FALSE(Read("../../far/secret.mtl").companions.at(0).inside);
  EXPECT_TRUE(Read("../looks/beside.mtl").companions.at(0).inside);
}

TEST_F(ObjPaths, PicturesAsWell) {
  ASSERT_TRUE(WriteFile(folder_ / "top/looks/p.mtl",
                        "newmtl a\nmap_Kd p.png\nnewmtl b\nmap_Kd ../mesh/p.png\nnewmtl c\nmap_Kd "
                        "../../far/p.png\nnewmtl d\nmap_Kd /dev/zero\n")
                  .has_value());
  const RawMesh mesh = Read("../looks/p.mtl");
  std::vector<std::string> pictures;
  for (const RawMaterial& material : mesh.materials) {
    pictures.push_back(material.picture.lexically_normal().string());
  }
  EXPECT_EQ(pictures,
            (std::vector<std::string>{(folder_ / "top/looks/p.png").string(),
                                      (folder_ / "top/mesh/p.png").string(), "", "", ""}));
  EXPECT_EQ(mesh.remarks.size(), 2U);
}

// By whatever names a library goes, it is read once.
TEST_F(ObjPaths, ALibraryOfManyNamesIsReadOnce) {
  ASSERT_TRUE(WriteFile(folder_ / "top/mesh/bad.mtl", "newmtl red\nKd x 0 0\n").has_value());
  const RawMesh mesh =
      Read("bad.mtl\nmtllib ./bad.mtl\nmtllib sub/../bad.mtl\nmtllib ../mesh/bad.mtl");
  EXPECT_EQ(mesh.remarks.size(), 1U);
}

TEST_F(ObjPaths, WhereOnlyTheSurfaceIsWantedNothingIsOpened) {
  const RawMesh mesh = Read("near.mtl", Materials::kSkip);
  EXPECT_EQ(mesh.triangles.size(), 1U);
  EXPECT_TRUE(mesh.companions.empty());
  EXPECT_TRUE(mesh.remarks.empty());
}

}  // namespace
}  // namespace tsdfpp
