#include "sim/models/blob_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace tsdfpp {
namespace {

// A minimum whose crease is rounded over about k (polynomial).
double SmoothMin(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * k / 4;
}

struct Grid {
  Eigen::Vector3d low;
  double cell = 0;
  Eigen::Vector3i nodes;

  std::size_t Node(const Eigen::Vector3i& at) const {
    return static_cast<std::size_t>((at.z() * nodes.y() + at.y()) * nodes.x() + at.x());
  }
  Eigen::Vector3d Place(const Eigen::Vector3i& at) const { return low + cell * at.cast<double>(); }
};

// Along the gradient to the surface, but not out of its cell's neighbourhood.
Eigen::Vector3d OntoSurface(const BlobField& field, const Eigen::Vector3d& start, double cell) {
  constexpr int kSteps = 6;
  const double h = 1e-3 * cell;
  Eigen::Vector3d p = start;
  for (int i = 0; i < kSteps; ++i) {
    const double value = field(p);
    Eigen::Vector3d gradient;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(k);
      gradient[k] = (field(p + step) - field(p - step)) / (2 * h);
    }
    if (!(gradient.squaredNorm() > 1e-6)) break;
    const Eigen::Vector3d next = p - value * gradient / gradient.squaredNorm();
    if ((next - start).cwiseAbs().maxCoeff() > cell / 2) break;
    p = next;
  }
  return p;
}

constexpr std::uint32_t kNone = 0xFFFFFFFF;

// A field at the nodes of a grid.
struct SampledField {
  Grid grid;
  std::vector<double> value;

  double At(const Eigen::Vector3i& node) const { return value[grid.Node(node)]; }
  bool IsInside(const Eigen::Vector3i& node) const { return At(node) < 0; }
};

SampledField Sample(const BlobField& field, const Eigen::AlignedBox3d& box, double cell) {
  SampledField samples;
  Grid& grid = samples.grid;
  grid = {box.min() - Eigen::Vector3d::Constant(1.5 * cell), cell, {}};
  grid.nodes = ((box.sizes() / cell).array().ceil().cast<int>() + 4).matrix();
  samples.value.resize(static_cast<std::size_t>(grid.nodes.prod()));
  for (int z = 0; z < grid.nodes.z(); ++z) {
    for (int y = 0; y < grid.nodes.y(); ++y) {
      for (int x = 0; x < grid.nodes.x(); ++x) {
        samples.value[grid.Node({x, y, z})] = field(grid.Place({x, y, z}));
      }
    }
  }
  return samples;
}

// The mean of the points where the surface crosses the edges of the cell above `low`; nothing where
// it crosses none.
std::optional<Eigen::Vector3d> MeanCrossing(const SampledField& samples,
                                            const Eigen::Vector3i& low) {
  const Grid& grid = samples.grid;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int crossings = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 4; ++side) {
      Eigen::Vector3i a = low;
      a[(axis + 1) % 3] += side & 1;
      a[(axis + 2) % 3] += side >> 1;
      const Eigen::Vector3i b = a + Eigen::Vector3i::Unit(axis);
      const double va = samples.At(a);
      const double vb = samples.At(b);
      if ((va < 0) == (vb < 0)) continue;
      sum += grid.Place(a) + va / (va - vb) * (grid.Place(b) - grid.Place(a));
      ++crossings;
    }
  }
  if (crossings == 0) return std::nullopt;
  return sum / crossings;
}

// A vertex in each cell that the surface crosses. Returns its index at the cell's lowest node.
std::vector<std::uint32_t> PlaceVertices(const BlobField& field, const SampledField& samples,
                                         Shape& shape) {
  const Grid& grid = samples.grid;
  std::vector<std::uint32_t> vertex(samples.value.size(), kNone);
  for (int z = 0; z + 1 < grid.nodes.z(); ++z) {
    for (int y = 0; y + 1 < grid.nodes.y(); ++y) {
      for (int x = 0; x + 1 < grid.nodes.x(); ++x) {
        const auto mean = MeanCrossing(samples, {x, y, z});
        if (!mean) continue;
        vertex[grid.Node({x, y, z})] = static_cast<std::uint32_t>(shape.vertices.size());
        shape.vertices.push_back(OntoSurface(field, *mean, grid.cell));
      }
    }
  }
  return vertex;
}

// A quad as two triangles, cut along its shorter diagonal.
void AddQuad(const std::array<std::uint32_t, 4>& quad, Shape& shape) {
  const auto& p = shape.vertices;
  const bool first = (p[quad[0]] - p[quad[2]]).norm() < (p[quad[1]] - p[quad[3]]).norm();
  const std::size_t s = first ? 0 : 1;
  shape.triangles.push_back({quad[s], quad[s + 1], quad[s + 2]});
  shape.triangles.push_back({quad[s], quad[s + 2], quad[(s + 3) % 4]});
}

// Each grid edge that the surface crosses gives a face between the four cells around it.
void JoinVertices(const SampledField& samples, const std::vector<std::uint32_t>& vertex,
                  Shape& shape) {
  const Grid& grid = samples.grid;
  for (int z = 1; z + 1 < grid.nodes.z(); ++z) {
    for (int y = 1; y + 1 < grid.nodes.y(); ++y) {
      for (int x = 1; x + 1 < grid.nodes.x(); ++x) {
        const Eigen::Vector3i at(x, y, z);
        for (int axis = 0; axis < 3; ++axis) {
          const bool here = samples.IsInside(at);
          if (here == samples.IsInside(at + Eigen::Vector3i::Unit(axis))) continue;
          const Eigen::Vector3i u = Eigen::Vector3i::Unit((axis + 1) % 3);
          const Eigen::Vector3i v = Eigen::Vector3i::Unit((axis + 2) % 3);
          std::array<std::uint32_t, 4> quad{vertex[grid.Node(at - u - v)],
                                            vertex[grid.Node(at - v)], vertex[grid.Node(at)],
                                            vertex[grid.Node(at - u)]};
          if (!here) std::swap(quad[1], quad[3]);
          AddQuad(quad, shape);
        }
      }
    }
  }
}

}  // namespace

BlobField Ellipsoid(const Eigen::Vector3d& centre, const Eigen::Vector3d& radii) {
  return [=](const Eigen::Vector3d& p) {
    // The usual first-order distance.
    const Eigen::Vector3d scaled = (p - centre).cwiseQuotient(radii);
    const double k0 = scaled.norm();
    const double k1 = scaled.cwiseQuotient(radii).norm();
    return k1 > 0 ? k0 * (k0 - 1) / k1 : -radii.minCoeff();
  };
}

BlobField Limb(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_a,
               double radius_b) {
  return [=](const Eigen::Vector3d& p) {
    const Eigen::Vector3d along = b - a;
    const double t = std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
    return (p - a - t * along).norm() - (radius_a + t * (radius_b - radius_a));
  };
}

BlobField Joined(std::vector<BlobField> fields, double fillet) {
  return [fields = std::move(fields), fillet](const Eigen::Vector3d& p) {
    double value = fields.front()(p);
    for (std::size_t i = 1; i < fields.size(); ++i) value = SmoothMin(value, fields[i](p), fillet);
    return value;
  };
}

BlobField Common(BlobField one, BlobField other, double round) {
  return [one = std::move(one), other = std::move(other), round](const Eigen::Vector3d& p) {
    return -SmoothMin(-one(p), -other(p), round);
  };
}

BlobField Below(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  return [=, unit = Eigen::Vector3d(normal.normalized())](const Eigen::Vector3d& p) {
    return (p - point).dot(unit);
  };
}

BlobField Swollen(BlobField field, double distance) {
  return [field = std::move(field), distance](const Eigen::Vector3d& p) {
    return field(p) - distance;
  };
}

Shape MakeBlob(const BlobField& field, const Eigen::AlignedBox3d& box, double cell) {
  const SampledField samples = Sample(field, box, cell);
  Shape shape;
  const std::vector<std::uint32_t> vertex = PlaceVertices(field, samples, shape);
  JoinVertices(samples, vertex, shape);
  return shape;
}

}  // namespace tsdfpp
