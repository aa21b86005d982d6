#include "mapper/mesh/join_parts.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace tsdfpp {
namespace {

constexpr std::size_t kPartsPerTask = 8;

std::size_t VisibleTriangles(const MeshPart& part) {
  std::size_t count = part.triangles.size();
  for (const std::uint8_t hidden : part.hidden) count -= hidden;
  return count;
}

// A part and its place in the joined mesh.
struct Piece {
  const MeshPart* part;
  const JoinedMesh* of;
  std::size_t first_triangle;
};

void WriteVertices(const Piece& piece, TriangleMesh& mesh) {
  const MeshPart& part = *piece.part;
  const std::vector<Eigen::Vector3f>& positions = part.PositionsInWorld();
  std::size_t to = part.first_vertex;
  if (!piece.of->visible_only || part.renamed.empty()) {
    std::copy(positions.begin(), positions.end(),
              mesh.vertices.begin() + static_cast<std::ptrdiff_t>(to));
    std::copy(part.colours.begin(), part.colours.end(),
              mesh.colours.begin() + static_cast<std::ptrdiff_t>(to));
    return;
  }
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (part.renamed[i] == kNotShown) continue;
    mesh.vertices[to] = positions[i];
    mesh.colours[to++] = part.colours[i];
  }
}

void WriteTriangles(const Piece& piece, TriangleMesh& mesh) {
  const MeshPart& part = *piece.part;
  const bool visible_only = piece.of->visible_only;
  std::array<std::uint32_t, 8> first{};
  std::array<const std::uint16_t*, 8> renamed{};
  bool any_renamed = false;
  for (std::size_t which = 0; which < 8; ++which) {
    const MeshPart* near = part.around[UpperPlace(which)];
    if (near == nullptr) continue;
    first[which] = near->first_vertex;
    if (!visible_only || near->renamed.empty()) continue;
    renamed[which] = near->renamed.data();
    any_renamed = true;
  }
  const bool all = !visible_only || part.hidden.empty();
  std::size_t to = piece.first_triangle;
  for (std::size_t t = 0; t < part.triangles.size(); ++t) {
    if (!all && part.hidden[t] != 0) continue;
    std::array<std::uint32_t, 3>& corners = mesh.triangles[to];
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t which = part.triangles[t][i] >> kLocalVertexBits;
      std::uint32_t local = part.triangles[t][i] & kLocalVertexMask;
      if (any_renamed && renamed[which] != nullptr) local = renamed[which][local];
      corners[i] = first[which] + local;
    }
    if (piece.of->id != kNoInstance) {
      mesh.face_ids[to] = piece.of->id;
    } else if (!part.face_ids.empty()) {
      mesh.face_ids[to] = part.face_ids[t];
    }
    ++to;
  }
}

// The part's triangles with vertices of their own, in the order in which they are named.
TriangleMesh MeshAlone(const MeshPart& part, const JoinedMesh& of) {
  constexpr std::uint32_t kNotYet = ~0U;
  thread_local std::vector<std::uint32_t> number(std::size_t{8} << kLocalVertexBits, kNotYet);
  thread_local std::vector<std::uint16_t> names;  // of the vertices
  TriangleMesh mesh;
  const std::size_t visible = of.visible_only ? VisibleTriangles(part) : part.triangles.size();
  if (visible == 0) return mesh;
  mesh.triangles.resize(visible);
  mesh.face_ids.assign(visible, of.id);
  const bool all = visible == part.triangles.size();
  names.clear();
  std::size_t to = 0;
  for (std::size_t t = 0; t < part.triangles.size(); ++t) {
    if (!all && part.hidden[t] != 0) continue;
    if (of.id == kNoInstance) mesh.face_ids[to] = part.face_ids[t];
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint16_t name = part.triangles[t][i];
      std::uint32_t& vertex = number[name];
      if (vertex == kNotYet) {
        vertex = static_cast<std::uint32_t>(names.size());
        names.push_back(name);
      }
      mesh.triangles[to][i] = vertex;
    }
    ++to;
  }
  mesh.vertices.reserve(names.size());
  mesh.colours.reserve(names.size());
  for (const std::uint16_t name : names) {
    number[name] = kNotYet;
    const MeshPart& near = *part.around[UpperPlace(name >> kLocalVertexBits)];
    const std::size_t local = name & kLocalVertexMask;
    mesh.vertices.push_back(near.PositionsInWorld()[local]);
    mesh.colours.push_back(near.colours[local]);
  }
  return mesh;
}

}  // namespace

std::vector<ScenePiece> TakeScenePieces(GridMesh& mesh, const JoinedMesh& of) {
  const GridMesh::Changes changes = mesh.TakeChanges();
  std::vector<ScenePiece> parts(changes.parts.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, parts.size(), kPartsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          parts[i] = {of.id, changes.parts[i]->index, MeshAlone(*changes.parts[i], of)};
        }
      },
      tbb::simple_partitioner());
  // Nobody needs to hear of what was empty and is.
  std::size_t kept = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const bool shows = !parts[i].mesh.triangles.empty();
    if (!std::exchange(changes.parts[i]->is_shown, shows) && !shows) continue;
    if (kept != i) parts[kept] = std::move(parts[i]);
    ++kept;
  }
  parts.resize(kept);
  for (const Index3& block : changes.gone) parts.push_back({of.id, block, {}});
  std::sort(parts.begin(), parts.end(),
            [](const ScenePiece& a, const ScenePiece& b) { return a.block < b.block; });
  return parts;
}

TriangleMesh Join(const std::vector<JoinedMesh>& meshes) {
  std::vector<Piece> pieces;
  std::size_t vertices = 0;
  std::size_t triangles = 0;
  bool labelled = false;
  for (const JoinedMesh& of : meshes) {
    for (MeshPart* part : of.mesh->parts()) {
      part->first_vertex = static_cast<std::uint32_t>(vertices);
      if (part->positions.empty() && part->triangles.empty()) continue;
      pieces.push_back({part, &of, triangles});
      vertices += of.visible_only && !part->renamed.empty() ? part->visible_vertices
                                                            : part->positions.size();
      triangles += of.visible_only ? VisibleTriangles(*part) : part->triangles.size();
      labelled = labelled || of.id != kNoInstance || !part->face_ids.empty();
    }
  }
  TriangleMesh mesh;
  mesh.vertices.resize(vertices);
  mesh.colours.resize(vertices);
  mesh.triangles.resize(triangles);
  if (labelled) mesh.face_ids.resize(triangles);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, pieces.size(), kPartsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          WriteVertices(pieces[i], mesh);
          WriteTriangles(pieces[i], mesh);
        }
      },
      tbb::simple_partitioner());
  return mesh;
}

}  // namespace tsdfpp
