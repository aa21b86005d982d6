#include "metrics/ghosts.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

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

GhostScores ScoreGhosts(const SampleSet& samples_W, std::span<const PlacedTruth> current,
                        double tau_m, const FreeSpace* observed) {
  GhostScores scores;
  scores.is_ghost.assign(samples_W.size(), 0);
  const NearestTruth nearest = FindNearestTruth(samples_W.points, current);
  std::vector<std::size_t> candidates;
  std::vector<Eigen::Vector3f> points_W;
  for (std::size_t i = 0; i < samples_W.size(); ++i) {
    if (static_cast<double>(nearest.distance_m[i]) <= tau_m) continue;
    candidates.push_back(i);
    points_W.push_back(samples_W.points[i]);
  }
  const Selection inside = InsideTruth(points_W, current);
  const Selection free =
      observed != nullptr ? observed->ObservedFree(points_W, tau_m) : Selection(points_W.size(), 1);
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    scores.is_ghost[candidates[k]] = inside[k] == 0 && free[k] != 0 ? 1 : 0;
  }
  scores.area_m2 = SelectedArea_m2(samples_W, scores.is_ghost);
  scores.share_of_mesh =
      ShareOf(samples_W, SelectAll(samples_W), scores.is_ghost, "the mesh is empty");
  return scores;
}

}  // namespace tsdfpp
