#include "metrics/ghosts.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "core/units.h"
#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

constexpr int kBlock = 4;
constexpr double kUnit_m = 0.0005;
constexpr std::uint16_t kFar = std::numeric_limits<std::uint16_t>::max();

std::uint16_t Quantise(double units) {
  return static_cast<std::uint16_t>(std::clamp(units, 0.0, static_cast<double>(kFar)));
}

}  // namespace

void FreeSpace::Observe(const Frame& frame) {
  View view;
  view.intrinsics = frame.intrinsics;
  view.T_CW = frame.T_WC.inverse();
  view.columns = (frame.depth.cols + kBlock - 1) / kBlock;
  const int rows = (frame.depth.rows + kBlock - 1) / kBlock;
  view.least.assign(static_cast<std::size_t>(view.columns * rows), 0);
  view.greatest = view.least;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < view.columns; ++c) {
      float least = std::numeric_limits<float>::infinity();
      float greatest = 0;
      bool valid = true;
      for (int y = r * kBlock; y < std::min((r + 1) * kBlock, frame.depth.rows); ++y) {
        const auto* row = frame.depth.ptr<float>(y);
        for (int x = c * kBlock; x < std::min((c + 1) * kBlock, frame.depth.cols); ++x) {
          valid = valid && IsValidDepth(row[x]);
          least = std::min(least, row[x]);
          greatest = std::max(greatest, row[x]);
        }
      }
      if (!valid) continue;
      const auto block = static_cast<std::size_t>(r * view.columns + c);
      view.least[block] = Quantise(std::floor(static_cast<double>(least) / kUnit_m));
      view.greatest[block] = Quantise(std::ceil(static_cast<double>(greatest) / kUnit_m));
    }
  }
  views_.push_back(std::move(view));
}

FreeSpace::Verdict FreeSpace::Ask(const View& view, const Eigen::Vector3d& p_W, double tau_m) {
  const Eigen::Vector3d p_C = view.T_CW * p_W;
  if (p_C.z() <= 0) return Verdict::kUnknown;
  const double u = view.intrinsics.fx * p_C.x() / p_C.z() + view.intrinsics.cx + 0.5;
  const double v = view.intrinsics.fy * p_C.y() / p_C.z() + view.intrinsics.cy + 0.5;
  if (!(u >= 0 && v >= 0 && u < view.intrinsics.width && v < view.intrinsics.height)) {
    return Verdict::kUnknown;
  }
  const auto block = static_cast<std::size_t>(static_cast<int>(v) / kBlock * view.columns +
                                              static_cast<int>(u) / kBlock);
  if (view.least[block] == 0) return Verdict::kUnknown;
  const double least = view.least[block] * kUnit_m;
  const double greatest = view.greatest[block] == kFar ? std::numeric_limits<double>::infinity()
                                                       : view.greatest[block] * kUnit_m;
  if (least > p_C.z() + tau_m) return Verdict::kFree;
  if (least >= p_C.z() - tau_m && greatest <= p_C.z() + tau_m) return Verdict::kSurface;
  return Verdict::kUnknown;
}

Selection FreeSpace::ObservedFree(std::span<const Eigen::Vector3f> points_W, double tau_m) const {
  Selection free(points_W.size(), 0);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points_W.size(), 256),
                    [&](const auto& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        const Eigen::Vector3d p_W = points_W[i].cast<double>();
                        for (auto view = views_.rbegin(); view != views_.rend(); ++view) {
                          const Verdict verdict = Ask(*view, p_W, tau_m);
                          if (verdict == Verdict::kUnknown) continue;
                          free[i] = verdict == Verdict::kFree ? 1 : 0;
                          break;
                        }
                      }
                    });
  return free;
}

namespace {

// Cutting stops at so many pieces: what is left undecided is sampled.
constexpr std::size_t kMostPieces = 4'000'000;
// Distances are in single precision.
constexpr double kDistanceRounding_m = 1e-5;
// Triangles of a mesh that follow each other are mostly near the same true triangle.
constexpr std::size_t kRun = 16;

using Corners = std::array<Eigen::Vector3f, 3>;

// Triangles as three corners each, and the triangle of the mesh that each is a piece of.
struct Pieces {
  std::vector<Corners> corners;
  std::vector<std::uint32_t> of;
  void Add(const Corners& piece, std::uint32_t triangle) {
    corners.push_back(piece);
    of.push_back(triangle);
  }
};

Corners CornersOf(const TriangleMesh& mesh, std::size_t triangle) {
  return {Corner(mesh, triangle, 0), Corner(mesh, triangle, 1), Corner(mesh, triangle, 2)};
}

Eigen::Vector3f Centroid(const Corners& piece) { return (piece[0] + piece[1] + piece[2]) / 3.0F; }

// The true triangle, in the world, that is nearest to each point; none where there is no truth.
std::vector<std::optional<Corners>> NearestTriangles(const NearestTruth& nearest,
                                                     std::span<const PlacedTruth> truths) {
  std::vector<std::optional<Corners>> triangles(nearest.object.size());
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    for (const PlacedTruth& truth : truths) {
      if (truth.surface->id() != nearest.object[i]) continue;
      Corners corners = CornersOf(truth.surface->model().mesh_O, nearest.triangle[i]);
      for (Eigen::Vector3f& corner : corners) {
        corner = (truth.T_WO * corner.cast<double>()).cast<float>();
      }
      triangles[i] = corners;
      break;
    }
  }
  return triangles;
}

// Whether all of the piece is within tau of one triangle: the distance to a convex set is largest
// at a corner.
bool IsAllNear(const Corners& piece, const std::optional<Corners>& truth, double tau_m) {
  if (!truth) return false;
  return std::all_of(piece.begin(), piece.end(), [&](const Eigen::Vector3f& corner) {
    const double distance = PointTriangleDistance(corner, (*truth)[0], (*truth)[1], (*truth)[2]);
    return distance + kDistanceRounding_m <= tau_m;
  });
}

// The triangles of the mesh but for those near the true triangle that one of their run, or of the
// run before or after it, is nearest to. Takes away most at a fraction of the queries.
Pieces NotOnTheTruth(const TriangleMesh& mesh, std::span<const PlacedTruth> current, double tau_m) {
  std::vector<Eigen::Vector3f> asked;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += kRun) {
    asked.push_back(Centroid(CornersOf(mesh, t)));
  }
  const auto truths = NearestTriangles(FindNearestTruth(asked, current), current);
  Selection near(mesh.triangles.size(), 0);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, truths.size(), 64), [&](const auto& range) {
    for (std::size_t run = range.begin(); run < range.end(); ++run) {
      const std::size_t end = std::min((run + 1) * kRun, mesh.triangles.size());
      for (std::size_t t = run * kRun; t < end; ++t) {
        const Corners piece = CornersOf(mesh, t);
        near[t] = IsAllNear(piece, truths[run], tau_m) ||
                  (run > 0 && IsAllNear(piece, truths[run - 1], tau_m)) ||
                  (run + 1 < truths.size() && IsAllNear(piece, truths[run + 1], tau_m));
      }
    }
  });
  Pieces pieces;
  for (std::size_t t = 0; t < near.size(); ++t) {
    if (near[t] == 0) pieces.Add(CornersOf(mesh, t), static_cast<std::uint32_t>(t));
  }
  return pieces;
}

// What of the mesh may lie farther than `tau_m` from all of `current`.
Pieces MayBeFar(const TriangleMesh& mesh, std::span<const PlacedTruth> current, double tau_m) {
  Pieces asked = NotOnTheTruth(mesh, current, tau_m);
  Pieces may;
  std::size_t made = asked.of.size();
  std::vector<Eigen::Vector3f> centroids;
  while (!asked.of.empty()) {
    centroids.clear();
    for (const Corners& piece : asked.corners) centroids.push_back(Centroid(piece));
    const NearestTruth nearest = FindNearestTruth(centroids, current);
    const auto truths = NearestTriangles(nearest, current);
    Pieces cut;
    for (std::size_t i = 0; i < centroids.size(); ++i) {
      const Corners& piece = asked.corners[i];
      double radius = 0;
      std::size_t longest = 0;
      double longest2 = -1;
      for (std::size_t k = 0; k < 3; ++k) {
        const double length2 = (piece[(k + 1) % 3] - piece[k]).cast<double>().squaredNorm();
        radius = std::max(radius, (piece[k] - centroids[i]).cast<double>().norm());
        if (length2 <= longest2) continue;
        longest2 = length2;
        longest = k;
      }
      const double distance = nearest.distance_m[i];
      if (distance + radius + kDistanceRounding_m <= tau_m) continue;
      if (IsAllNear(piece, truths[i], tau_m)) continue;
      if (distance - radius > tau_m || 2 * radius <= tau_m || made >= kMostPieces) {
        may.Add(piece, asked.of[i]);
        continue;
      }
      const Eigen::Vector3f& a = piece[longest];
      const Eigen::Vector3f& b = piece[(longest + 1) % 3];
      const Eigen::Vector3f& c = piece[(longest + 2) % 3];
      const Eigen::Vector3f middle = 0.5F * (a + b);
      cut.Add({a, middle, c}, asked.of[i]);
      cut.Add({middle, b, c}, asked.of[i]);
      made += 2;
    }
    asked = std::move(cut);
  }
  return may;
}

// What is known of the space at each point; nothing where there is no ghost.
std::vector<std::optional<GhostSpace>> Judge(std::span<const Eigen::Vector3f> points_W,
                                             std::span<const PlacedTruth> current,
                                             std::span<const PlacedTruth> removed, double tau_m,
                                             const FreeSpace& observed) {
  std::vector<std::optional<GhostSpace>> space(points_W.size());
  std::vector<std::size_t> left(points_W.size());
  std::iota(left.begin(), left.end(), 0U);
  std::vector<Eigen::Vector3f> points(points_W.begin(), points_W.end());
  const auto keep = [&](const auto& kept) {
    std::size_t count = 0;
    for (std::size_t k = 0; k < left.size(); ++k) {
      if (!kept(k)) continue;
      left[count] = left[k];
      points[count++] = points[k];
    }
    left.resize(count);
    points.resize(count);
  };
  const auto is_far = [&](const NearestTruth& nearest, std::size_t k) {
    return static_cast<double>(nearest.distance_m[k]) > tau_m;
  };
  const NearestTruth nearest = FindNearestTruth(points, current);
  keep([&](std::size_t k) { return is_far(nearest, k); });
  const std::vector<std::uint8_t> inside = InsideTruth(points, current);
  keep([&](std::size_t k) { return inside[k] == 0; });
  const NearestTruth vacated = FindNearestTruth(points, removed);
  const std::vector<std::uint8_t> within = InsideTruth(points, removed);
  keep([&](std::size_t k) {
    if (is_far(vacated, k) && within[k] == 0) return true;
    space[left[k]] = GhostSpace::kVacated;
    return false;
  });
  const Selection free = observed.ObservedFree(points, tau_m);
  for (std::size_t k = 0; k < left.size(); ++k) {
    space[left[k]] = free[k] != 0 ? GhostSpace::kSeenFree : GhostSpace::kUnseen;
  }
  return space;
}

}  // namespace

GhostScores ScoreGhosts(const TriangleMesh& mesh_W, std::span<const PlacedTruth> current,
                        std::span<const PlacedTruth> removed, double tau_m,
                        const FreeSpace& observed, const GhostSampling& sampling) {
  GhostScores scores;
  const double mesh_m2 = SurfaceArea(mesh_W);
  scores.share_of_mesh = Measured::Undefined("the mesh is empty");
  if (!(mesh_m2 > 0)) return scores;
  const Pieces pieces = MayBeFar(mesh_W, current, tau_m);
  TriangleMesh may;
  for (const auto& corners : pieces.corners) {
    const auto first = static_cast<std::uint32_t>(may.vertices.size());
    may.vertices.insert(may.vertices.end(), corners.begin(), corners.end());
    may.triangles.push_back({first, first + 1, first + 2});
  }
  const double may_cm2 = kCm2PerM2 * SurfaceArea(may);
  const double per_cm2 =
      may_cm2 > 0 ? std::min(sampling.per_cm2, static_cast<double>(sampling.max_samples) / may_cm2)
                  : 0;
  // Two independent samples a stretch.
  std::array<std::vector<std::optional<GhostSpace>>, 2> space;
  double stretch_m2 = 0;
  for (std::uint32_t stream = 0; stream < 2; ++stream) {
    const SampleSet samples = SampleMesh(may, 0.5 * per_cm2, sampling.seed, stream);
    space[stream] = Judge(samples.points, current, removed, tau_m, observed);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (!space[stream][i]) continue;
      SampleSet& ghosts = scores.samples;
      ghosts.points.push_back(samples.points[i]);
      ghosts.normals.push_back(samples.normals[i]);
      ghosts.region.push_back(0);
      ghosts.triangle.push_back(pieces.of[samples.triangle[i]]);
      ghosts.area_m2.push_back(0.5F * samples.area_m2[i]);
      scores.sample_space.push_back(*space[stream][i]);
    }
    if (samples.size() > 0) stretch_m2 = may_cm2 / kCm2PerM2 / static_cast<double>(samples.size());
  }
  const auto estimate = [&](const auto& belongs) {
    double hits = 0;
    double unlike = 0;
    for (std::size_t i = 0; i < space[0].size(); ++i) {
      const bool a = space[0][i] && belongs(*space[0][i]);
      const bool b = space[1][i] && belongs(*space[1][i]);
      hits += static_cast<double>(a) + static_cast<double>(b);
      if (a != b) unlike += 1;
    }
    return AreaEstimate{0.5 * stretch_m2 * hits, 0.5 * stretch_m2 * std::sqrt(unlike)};
  };
  for (std::size_t k = 0; k < scores.space.size(); ++k) {
    scores.space[k] = estimate([&](GhostSpace s) { return static_cast<std::size_t>(s) == k; });
  }
  scores.ghosts = estimate([](GhostSpace s) { return s != GhostSpace::kUnseen; });
  scores.share_of_mesh = Measured::Of(scores.ghosts.area_m2 / mesh_m2);
  return scores;
}

}  // namespace tsdfpp
