#include "mapper/associate/candidates.h"

#include <algorithm>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {

Candidates::Candidates(const VoteConfig& config, double voxel_m)
    : config_(config), cell_m_(0.5 * config.near_voxels * voxel_m) {}

std::vector<Index3> Candidates::CellsOf(const std::vector<Eigen::Vector3d>& points_W) const {
  std::vector<Index3> cells;
  cells.reserve(points_W.size());
  for (const Eigen::Vector3d& p_W : points_W) cells.push_back(FloorOf(p_W / cell_m_));
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  return cells;
}

bool Candidates::IsNear(const Index3& cell, const std::vector<Index3>& cells) {
  for (int i = 0; i < 27; ++i) {
    const Index3 beside = cell + Index3{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    if (std::binary_search(cells.begin(), cells.end(), beside)) return true;
  }
  return false;
}

double Candidates::ShareNear(const std::vector<Eigen::Vector3d>& points_W,
                             const std::vector<Index3>& cells) const {
  const auto near = std::count_if(
      points_W.begin(), points_W.end(),
      [&](const Eigen::Vector3d& p_W) { return IsNear(FloorOf(p_W / cell_m_), cells); });
  return static_cast<double>(near) / static_cast<double>(points_W.size());
}

std::vector<bool> Candidates::Confirm(const std::vector<std::vector<Eigen::Vector3d>>& segments_W) {
  ++frame_;
  struct Pair {
    double overlap;
    std::size_t segment;
    std::size_t candidate;
  };
  std::vector<Pair> pairs;
  std::vector<bool> is_large(segments_W.size());
  for (std::size_t s = 0; s < segments_W.size(); ++s) {
    is_large[s] = segments_W[s].size() >= static_cast<std::size_t>(config_.min_points);
    if (!is_large[s]) continue;
    const std::vector<Index3> cells = CellsOf(segments_W[s]);
    for (std::size_t c = 0; c < candidates_.size(); ++c) {
      const std::vector<Index3>& others = candidates_[c].cells;
      const double share = ShareNear(segments_W[s], others);
      if (share < config_.near_share) continue;
      // A large segment beside a small one is near all of it, but not the other way round.
      const auto back = std::count_if(others.begin(), others.end(),
                                      [&](const Index3& cell) { return IsNear(cell, cells); });
      pairs.push_back(
          {share * static_cast<double>(back) / static_cast<double>(others.size()), s, c});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.overlap > b.overlap; });
  std::vector<std::optional<std::size_t>> candidate_of(segments_W.size());
  std::vector<bool> is_taken(candidates_.size());
  for (const Pair& pair : pairs) {
    if (candidate_of[pair.segment] || is_taken[pair.candidate]) continue;
    candidate_of[pair.segment] = pair.candidate;
    is_taken[pair.candidate] = true;
  }

  std::vector<bool> is_confirmed(segments_W.size());
  std::vector<Candidate> left;
  for (std::size_t s = 0; s < segments_W.size(); ++s) {
    if (!is_large[s]) continue;
    Candidate candidate;
    if (candidate_of[s]) candidate = std::move(candidates_[*candidate_of[s]]);
    candidate.seen.push_back(frame_);
    while (candidate.seen.front() <= frame_ - config_.confirm_window) candidate.seen.pop_front();
    is_confirmed[s] = static_cast<int>(candidate.seen.size()) >= config_.confirm_frames;
    if (is_confirmed[s]) continue;
    candidate.cells = CellsOf(segments_W[s]);
    left.push_back(std::move(candidate));
  }
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    // The next frame's window does not reach back to it.
    if (is_taken[c] || candidates_[c].seen.back() <= frame_ - config_.confirm_window + 1) continue;
    left.push_back(std::move(candidates_[c]));
  }
  candidates_ = std::move(left);
  return is_confirmed;
}

}  // namespace tsdfpp
