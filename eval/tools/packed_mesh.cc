#include "eval/tools/packed_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cstring>
#include <unordered_set>

namespace tsdfpp {
namespace {

constexpr float kMargin_m = 1.0F;
constexpr float kSteps = 65535.0F;

// A triangle by what it is, not by the numbers of its vertices.
struct TriangleKey {
  std::array<float, 9> coordinates;
  InstanceId id;
  bool operator==(const TriangleKey&) const = default;
};

struct TriangleKeyHash {
  std::size_t operator()(const TriangleKey& key) const {
    std::uint64_t hash = key.id;
    for (const float x : key.coordinates) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &x, sizeof bits);
      hash = (hash ^ bits) * 0x9E3779B97F4A7C15ULL;
      hash ^= hash >> 29U;
    }
    return hash;
  }
};

TriangleKey KeyOf(const TriangleMesh& mesh, std::size_t triangle) {
  TriangleKey key{};
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const Eigen::Vector3f& p = mesh.vertices[mesh.triangles[triangle][corner]];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      // One zero, for the hash goes by bits.
      key.coordinates[3 * corner + axis] = p[static_cast<Eigen::Index>(axis)] + 0.0F;
    }
  }
  key.id = mesh.face_ids[triangle];
  return key;
}

using TriangleSet = std::unordered_set<TriangleKey, TriangleKeyHash>;

TriangleSet KeysOf(const TriangleMesh& mesh) {
  TriangleSet keys;
  keys.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) keys.insert(KeyOf(mesh, t));
  return keys;
}

// A mesh of the same vertices without triangles.
TriangleMesh VerticesOf(const TriangleMesh& mesh) { return {mesh.vertices, {}, mesh.colours, {}}; }

void Take(const TriangleMesh& from, std::size_t triangle, TriangleMesh& to) {
  to.triangles.push_back(from.triangles[triangle]);
  to.face_ids.push_back(from.face_ids[triangle]);
}

// Drops the vertices that no triangle has.
TriangleMesh Compact(const TriangleMesh& mesh) {
  constexpr std::uint32_t kUnused = 0xFFFFFFFF;
  std::vector<std::uint32_t> at(mesh.vertices.size(), kUnused);
  TriangleMesh out;
  out.face_ids = mesh.face_ids;
  out.triangles.reserve(mesh.triangles.size());
  for (std::array<std::uint32_t, 3> triangle : mesh.triangles) {
    for (std::uint32_t& v : triangle) {
      if (at[v] == kUnused) {
        at[v] = static_cast<std::uint32_t>(out.vertices.size());
        out.vertices.push_back(mesh.vertices[v]);
        if (!mesh.colours.empty()) out.colours.push_back(mesh.colours[v]);
      }
      v = at[v];
    }
    out.triangles.push_back(triangle);
  }
  return out;
}

}  // namespace

PositionGrid GridAround(const Eigen::AlignedBox3f& box) {
  PositionGrid grid;
  if (box.isEmpty()) return grid;
  grid.origin = box.min() - Eigen::Vector3f::Constant(kMargin_m);
  grid.step_m = (box.sizes().maxCoeff() + 2 * kMargin_m) / kSteps;
  return grid;
}

bool Holds(const PositionGrid& grid, const Eigen::AlignedBox3f& box) {
  const Eigen::AlignedBox3f whole(grid.origin,
                                  grid.origin + Eigen::Vector3f::Constant(kSteps * grid.step_m));
  return whole.contains(box);
}

RemovalLayers CutByRemoval(const TriangleMesh& scene_W, const TriangleMesh& revealed_W,
                           const std::vector<InstanceId>& movers) {
  RemovalLayers layers{VerticesOf(scene_W), VerticesOf(scene_W), VerticesOf(revealed_W)};
  const TriangleSet after = KeysOf(revealed_W);
  for (std::size_t t = 0; t < scene_W.triangles.size(); ++t) {
    if (std::find(movers.begin(), movers.end(), scene_W.face_ids[t]) != movers.end()) continue;
    Take(scene_W, t, after.contains(KeyOf(scene_W, t)) ? layers.common : layers.gone);
  }
  const TriangleSet before = KeysOf(scene_W);
  for (std::size_t t = 0; t < revealed_W.triangles.size(); ++t) {
    if (!before.contains(KeyOf(revealed_W, t))) Take(revealed_W, t, layers.revealed);
  }
  return {Compact(layers.common), Compact(layers.gone), Compact(layers.revealed)};
}

TriangleMesh Decimate(const TriangleMesh& mesh, std::size_t triangles) {
  if (mesh.triangles.empty()) return {};
  const auto* indices = mesh.triangles.front().data();
  const std::size_t count = 3 * mesh.triangles.size();
  std::vector<unsigned int> remap(mesh.vertices.size());
  const std::size_t joined =
      meshopt_generateVertexRemap(remap.data(), indices, count, mesh.vertices.data(),
                                  mesh.vertices.size(), sizeof(Eigen::Vector3f));
  TriangleMesh out;
  out.vertices.resize(joined);
  if (!mesh.colours.empty()) out.colours.resize(joined);
  for (std::size_t v = mesh.vertices.size(); v-- > 0;) {
    if (remap[v] >= joined) continue;  // no triangle has it
    out.vertices[remap[v]] = mesh.vertices[v];
    if (!mesh.colours.empty()) out.colours[remap[v]] = mesh.colours[v];
  }
  std::vector<unsigned int> welded(count);
  for (std::size_t i = 0; i < count; ++i) welded[i] = remap[indices[i]];
  std::vector<unsigned int> kept(count);
  if (mesh.triangles.size() > triangles) {
    constexpr float kAnyError = 1.0F;  // of the mesh's extent: the count alone decides
    kept.resize(meshopt_simplify(kept.data(), welded.data(), count, out.vertices.front().data(),
                                 joined, sizeof(Eigen::Vector3f), 3 * triangles, kAnyError,
                                 meshopt_SimplifyLockBorder, nullptr));
  } else {
    kept = welded;
  }
  for (std::size_t i = 0; i + 2 < kept.size(); i += 3) {
    out.triangles.push_back({kept[i], kept[i + 1], kept[i + 2]});
  }
  return Compact(out);
}

PackedMesh Pack(const TriangleMesh& mesh, const VertexMeasures& measures,
                const PositionGrid& grid) {
  PackedMesh packed;
  if (mesh.triangles.empty()) return packed;
  std::vector<PackedVertex> vertices(mesh.vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const Eigen::Vector3f n = (mesh.vertices[v] - grid.origin) / grid.step_m;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      vertices[v].position[axis] =
          static_cast<std::uint16_t>(std::lround(std::clamp(n[axis], 0.0F, kSteps)));
    }
    vertices[v].error = measures.error.empty() ? 0 : measures.error[v];
    vertices[v].age = measures.age.empty() ? 0 : measures.age[v];
    for (std::size_t c = 0; c < 3; ++c) {
      vertices[v].colour[c] = mesh.colours.empty() ? 0 : mesh.colours[v][c];
    }
  }
  // In the order in which a decoder meets them, both buffers are smaller.
  std::vector<unsigned int> indices(3 * mesh.triangles.size());
  std::memcpy(indices.data(), mesh.triangles.data(), indices.size() * sizeof(unsigned int));
  meshopt_optimizeVertexCache(indices.data(), indices.data(), indices.size(), vertices.size());
  std::vector<PackedVertex> ordered(vertices.size());
  packed.vertices =
      meshopt_optimizeVertexFetch(ordered.data(), indices.data(), indices.size(), vertices.data(),
                                  vertices.size(), sizeof(PackedVertex));
  packed.triangles = mesh.triangles.size();
  packed.vertex_bytes.resize(
      meshopt_encodeVertexBufferBound(packed.vertices, sizeof(PackedVertex)));
  packed.vertex_bytes.resize(meshopt_encodeVertexBuffer(
      reinterpret_cast<unsigned char*>(packed.vertex_bytes.data()), packed.vertex_bytes.size(),
      ordered.data(), packed.vertices, sizeof(PackedVertex)));
  packed.index_bytes.resize(meshopt_encodeIndexBufferBound(indices.size(), packed.vertices));
  packed.index_bytes.resize(
      meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(packed.index_bytes.data()),
                                packed.index_bytes.size(), indices.data(), indices.size()));
  return packed;
}

bool IsPackedMesh(std::string_view vertex_bytes, std::size_t vertices, std::string_view index_bytes,
                  std::size_t triangles) {
  // Of an empty mesh nothing is packed.
  if (triangles == 0) return vertices == 0 && vertex_bytes.empty() && index_bytes.empty();
  // A triangle has a byte at least, and each vertex is one's: no number asks for more memory.
  if (triangles > index_bytes.size() || vertices > 3 * triangles) return false;
  const auto* vertex_data = reinterpret_cast<const unsigned char*>(vertex_bytes.data());
  const auto* index_data = reinterpret_cast<const unsigned char*>(index_bytes.data());
  std::vector<PackedVertex> unpacked(vertices);
  std::vector<unsigned int> indices(3 * triangles);
  return meshopt_decodeVertexBuffer(unpacked.data(), vertices, sizeof(PackedVertex), vertex_data,
                                    vertex_bytes.size()) == 0 &&
         meshopt_decodeIndexBuffer(indices.data(), indices.size(), sizeof(unsigned int), index_data,
                                   index_bytes.size()) == 0 &&
         std::all_of(indices.begin(), indices.end(), [&](unsigned int i) { return i < vertices; });
}

}  // namespace tsdfpp
