// Meshes as a report packs them: they come back within half a step, and decimation keeps borders.
#include "eval/tools/packed_mesh.h"

#include <gtest/gtest.h>

#include <set>

#include "eval/tools/base64.h"
#include "metrics/mesh_tools.h"
#include "tests/eval/unpacked_mesh.h"

namespace tsdfpp {
namespace {

using test::AreaOf;
using test::PlaceOf;
using test::Unpack;
using test::Unpacked;

// A square of n x n cells of `side` metres in the plane z = height, two triangles a cell.
TriangleMesh Sheet(int n, float side, InstanceId id) {
  TriangleMesh mesh;
  const auto at = [&](int x, int y) { return static_cast<std::uint32_t>(y * (n + 1) + x); };
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      mesh.vertices.emplace_back(side * static_cast<float>(x), side * static_cast<float>(y), 0.5F);
      mesh.colours.push_back({static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), 7});
    }
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      mesh.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      mesh.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  }
  mesh.face_ids.assign(mesh.triangles.size(), id);
  return mesh;
}

TEST(PackedMesh, ComesBackWithinHalfAStepWithItsColoursAndMeasures) {
  const TriangleMesh sheet = Sheet(20, 0.037F, 3);
  const PositionGrid grid = GridAround(BoundsOf(sheet));
  VertexMeasures measures;
  for (std::size_t v = 0; v < sheet.vertices.size(); ++v) {
    measures.error.push_back(static_cast<std::uint8_t>(v % 251));
    measures.age.push_back(static_cast<std::uint8_t>(v % 17));
  }
  const PackedMesh packed = Pack(sheet, measures, grid);
  ASSERT_EQ(packed.vertices, sheet.vertices.size());
  ASSERT_EQ(packed.triangles, sheet.triangles.size());
  const Unpacked back =
      Unpack(packed.vertex_bytes, packed.vertices, packed.index_bytes, packed.triangles);
  // Vertices are in another order: the colour says which one it was.
  std::set<std::size_t> met;
  for (const PackedVertex& vertex : back.vertices) {
    const std::size_t v = vertex.colour[1] * 21U + vertex.colour[0];
    ASSERT_LT(v, sheet.vertices.size());
    met.insert(v);
    const float off =
        (PlaceOf(vertex, grid.origin, grid.step_m) - sheet.vertices[v]).cwiseAbs().maxCoeff();
    EXPECT_LE(off, 0.51F * grid.step_m);
    EXPECT_EQ(vertex.error, measures.error[v]);
    EXPECT_EQ(vertex.age, measures.age[v]);
    EXPECT_EQ(vertex.colour[2], 7);
  }
  EXPECT_EQ(met.size(), sheet.vertices.size());
  EXPECT_NEAR(AreaOf(back, grid), SurfaceArea(sheet), 1e-3 * SurfaceArea(sheet));
}

TEST(PackedMesh, AGridHoldsWhatItWasMadeFor) {
  const Eigen::AlignedBox3f box(Eigen::Vector3f(-1, 2, 0), Eigen::Vector3f(3, 2.5F, 0.1F));
  const PositionGrid grid = GridAround(box);
  EXPECT_TRUE(Holds(grid, box));
  EXPECT_TRUE(Holds(grid, {}));  // nothing
  for (const float far : {2.0F, 8.0F}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3f by = far * Eigen::Vector3f::Unit(axis);
      EXPECT_FALSE(Holds(grid, {box.min() - by, box.max()}));
      EXPECT_EQ(Holds(grid, {box.min(), box.max() + by}), axis > 0 && far == 2) << axis;
    }
  }
}

TEST(PackedMesh, DecimationKeepsTheBorderAndThePlane) {
  const TriangleMesh sheet = Sheet(40, 0.02F, 1);
  const TriangleMesh small = Decimate(sheet, 400);
  EXPECT_LE(small.triangles.size(), 400U);
  EXPECT_GE(small.triangles.size(), 2U);
  EXPECT_NEAR(SurfaceArea(small), SurfaceArea(sheet), 1e-5);
  // All 160 vertices of the border are still there, so a neighbour that was cut off still meets it.
  int on_border = 0;
  for (const Eigen::Vector3f& p : small.vertices) {
    if (p.x() == 0 || p.y() == 0 || p.x() == BoundsOf(sheet).max().x() ||
        p.y() == BoundsOf(sheet).max().y()) {
      ++on_border;
    }
  }
  EXPECT_EQ(on_border, 160);
}

TEST(PackedMesh, DecimationJoinsVerticesAndTakesTheEmptyMesh) {
  TriangleMesh soup;
  const TriangleMesh sheet = Sheet(3, 0.1F, 1);
  for (const auto& triangle : sheet.triangles) {
    const auto first = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t v : triangle) soup.vertices.push_back(sheet.vertices[v]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  EXPECT_EQ(Decimate(soup, 1000).vertices.size(), 16U);
  EXPECT_EQ(Decimate(soup, 1000).triangles.size(), 18U);
  EXPECT_TRUE(Decimate(TriangleMesh{}, 10).triangles.empty());
}

TEST(PackedMesh, IsToldFromOtherBytes) {
  const PackedMesh packed = Pack(Sheet(4, 0.1F, 0), {}, PositionGrid{});
  const auto& [vertices, triangles, vertex_bytes, index_bytes] = packed;
  EXPECT_TRUE(IsPackedMesh(vertex_bytes, vertices, index_bytes, triangles));
  EXPECT_TRUE(IsPackedMesh("", 0, "", 0));
  EXPECT_FALSE(IsPackedMesh(index_bytes, vertices, vertex_bytes, triangles));
  EXPECT_FALSE(
      IsPackedMesh(std::string(vertex_bytes.size(), '\0'), vertices, index_bytes, triangles));
  EXPECT_FALSE(IsPackedMesh(vertex_bytes, vertices, index_bytes, std::size_t{1} << 60U));
  EXPECT_FALSE(IsPackedMesh(vertex_bytes, std::size_t{1} << 60U, index_bytes, triangles));
}

// The scene has triangles 0-5 of the table and a car; without the car triangle 5 goes and 6, 7
// come.
TEST(PackedMesh, ARemovalIsCutIntoWhatStaysGoesAndComes) {
  const TriangleMesh sheet = Sheet(2, 0.1F, 0);
  TriangleMesh scene = sheet;
  scene.triangles.resize(6);
  scene.face_ids.resize(6);
  scene.triangles.push_back(sheet.triangles[7]);
  scene.face_ids.push_back(4);  // the car, at a place where the table is
  TriangleMesh revealed = sheet;
  revealed.triangles.erase(revealed.triangles.begin() + 5);
  revealed.face_ids.pop_back();
  const RemovalLayers layers = CutByRemoval(scene, revealed, {4});
  EXPECT_EQ(layers.common.triangles.size(), 5U);
  EXPECT_EQ(layers.gone.triangles.size(), 1U);
  EXPECT_EQ(layers.revealed.triangles.size(), 2U);
  EXPECT_EQ(layers.gone.vertices.size(), 3U);  // no vertices that it does not use
}

TEST(Base64Text, IsThatOfTheStandard) {  // RFC 4648, section 10
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
}

}  // namespace
}  // namespace tsdfpp
