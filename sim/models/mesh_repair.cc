#include "sim/models/mesh_repair.h"

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

namespace tsdfpp {
namespace {

using Triangle = std::array<std::uint32_t, 3>;
using Edge = std::pair<std::uint32_t, std::uint32_t>;

struct PlaceHash {
  std::size_t operator()(const std::array<double, 3>& at) const {
    std::uint64_t hash = 0;
    for (const double value : at) {
      hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x9E3779B97F4A7C15ULL;
      hash ^= hash >> 29U;
    }
    return hash;
  }
};

Shape Weld(const std::vector<Eigen::Vector3d>& vertices,
           const std::vector<RawTriangle>& triangles) {
  Shape shape;
  std::unordered_map<std::array<double, 3>, std::uint32_t, PlaceHash> index;
  for (const RawTriangle& raw : triangles) {
    Triangle triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d& p = vertices[raw.vertex[k]];
      // Adding zero makes a positive zero of a negative one.
      const auto [entry, is_new] = index.try_emplace({p.x() + 0.0, p.y() + 0.0, p.z() + 0.0},
                                                     static_cast<std::uint32_t>(index.size()));
      if (is_new) shape.vertices.push_back(p);
      triangle[k] = entry->second;
    }
    shape.triangles.push_back(triangle);
  }
  return shape;
}

// The same three corners in the same sense, starting with the smallest.
Triangle Canonical(Triangle t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

bool HasArea(const Shape& shape, const Triangle& t) {
  const Eigen::Vector3d u = shape.vertices[t[1]] - shape.vertices[t[0]];
  const Eigen::Vector3d v = shape.vertices[t[2]] - shape.vertices[t[0]];
  const double longest = std::max({u.norm(), v.norm(), (u - v).norm()});
  // Rounding in the coordinates makes a straight line this wide.
  constexpr double kRoundOff = 1e-14;
  return u.cross(v).norm() > kRoundOff * longest * longest;
}

void KeepOnly(RepairedMesh& mesh, const std::vector<bool>& keep) {
  std::size_t to = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (!keep[i]) continue;
    mesh.shape.triangles[to] = mesh.shape.triangles[i];
    mesh.source[to] = mesh.source[i];
    mesh.is_turned[to] = mesh.is_turned[i];
    ++to;
  }
  mesh.shape.triangles.resize(to);
  mesh.source.resize(to);
  mesh.is_turned.resize(to);
}

// Triangles that name a vertex twice, and those that are there before.
void DropRepeated(RepairedMesh& mesh) {
  std::set<Triangle> seen;
  std::vector<bool> keep(mesh.source.size(), true);
  for (std::size_t i = 0; i < keep.size(); ++i) {
    const Triangle& t = mesh.shape.triangles[i];
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) {
      ++mesh.degenerate;
      keep[i] = false;
    } else if (!seen.insert(Canonical(t)).second) {
      ++mesh.duplicate;
      keep[i] = false;
    }
  }
  KeepOnly(mesh, keep);
}

struct Use {
  std::uint32_t triangle;
  bool forwards;  // runs the edge from its smaller vertex to its larger one
};

std::map<Edge, std::vector<Use>> EdgesOf(const Shape& shape) {
  std::map<Edge, std::vector<Use>> edges;
  for (std::uint32_t i = 0; i < shape.triangles.size(); ++i) {
    const Triangle& t = shape.triangles[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k];
      const std::uint32_t b = t[(k + 1) % 3];
      edges[{std::min(a, b), std::max(a, b)}].push_back({i, a < b});
    }
  }
  return edges;
}

// Turns faces of one piece to agree with its first.
class Orienter {
 public:
  explicit Orienter(RepairedMesh& mesh)
      : mesh_(mesh), neighbours_(mesh.source.size()), piece_of_(mesh.source.size(), kNone) {
    for (const auto& [edge, uses] : EdgesOf(mesh.shape)) {
      if (uses.size() != 2) {
        for (const Use& use : uses) open_at_.insert(use.triangle);
        continue;
      }
      const bool agrees = uses[0].forwards != uses[1].forwards;
      neighbours_[uses[0].triangle].emplace_back(uses[1].triangle, agrees);
      neighbours_[uses[1].triangle].emplace_back(uses[0].triangle, agrees);
    }
  }

  void Run() {
    for (std::uint32_t i = 0; i < piece_of_.size(); ++i) {
      if (piece_of_[i] == kNone) OrientPiece(i);
    }
    if (open_at_.empty() && SignedVolume(mesh_.shape) < 0) {
      for (std::uint32_t i = 0; i < piece_of_.size(); ++i) Turn(i);
    }
    mesh_.turned =
        static_cast<std::size_t>(std::count(mesh_.is_turned.begin(), mesh_.is_turned.end(), true));
  }

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;

  void Turn(std::uint32_t i) {
    std::swap(mesh_.shape.triangles[i][1], mesh_.shape.triangles[i][2]);
    mesh_.is_turned[i] = !mesh_.is_turned[i];
  }

  void OrientPiece(std::uint32_t first) {
    std::vector<std::uint32_t> piece{first};
    piece_of_[first] = first;
    std::size_t turned = 0;
    bool is_closed = true;
    for (std::size_t at = 0; at < piece.size(); ++at) {
      const std::uint32_t i = piece[at];
      is_closed = is_closed && !open_at_.contains(i);
      for (const auto& [other, agreed] : neighbours_[i]) {
        if (piece_of_[other] != kNone) continue;
        piece_of_[other] = first;
        piece.push_back(other);
        if (agreed == mesh_.is_turned[i]) {
          Turn(other);
          ++turned;
        }
      }
    }
    if (turned == 0) return;
    const bool inside_out = is_closed ? VolumeOf(piece) < 0 : 2 * turned > piece.size();
    if (inside_out) {
      for (const std::uint32_t i : piece) Turn(i);
    }
  }

  double VolumeOf(const std::vector<std::uint32_t>& piece) const {
    double six_volumes = 0;
    for (const std::uint32_t i : piece) {
      const auto& [a, b, c] = mesh_.shape.triangles[i];
      const auto& p = mesh_.shape.vertices;
      six_volumes += p[a].dot(p[b].cross(p[c]));
    }
    return six_volumes;
  }

  RepairedMesh& mesh_;
  std::vector<std::vector<std::pair<std::uint32_t, bool>>> neighbours_;  // and whether they agreed
  std::vector<std::uint32_t> piece_of_;
  std::set<std::uint32_t> open_at_;  // triangles with an edge that is not shared by two
};

}  // namespace

RepairedMesh Repair(const std::vector<Eigen::Vector3d>& vertices,
                    const std::vector<RawTriangle>& triangles) {
  RepairedMesh mesh;
  mesh.shape = Weld(vertices, triangles);
  mesh.source.resize(triangles.size());
  std::iota(mesh.source.begin(), mesh.source.end(), 0U);
  mesh.is_turned.assign(triangles.size(), false);
  DropRepeated(mesh);
  Orienter(mesh).Run();
  for (const auto& [edge, uses] : EdgesOf(mesh.shape)) {
    if (uses.size() != 2 || uses[0].forwards == uses[1].forwards) ++mesh.open_edges;
  }
  std::vector<bool> keep(mesh.source.size());
  for (std::size_t i = 0; i < keep.size(); ++i) {
    keep[i] = HasArea(mesh.shape, mesh.shape.triangles[i]);
    if (!keep[i]) ++mesh.degenerate;
  }
  KeepOnly(mesh, keep);
  return mesh;
}

}  // namespace tsdfpp
