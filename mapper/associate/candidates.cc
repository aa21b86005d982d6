#include "mapper/associate/candidates.h"

#include <algorithm>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {
namespace {

// The cell itself and those beside it, i from 0 to 26.
Index3 Beside(const Index3& cell, int i) {
  return cell + Index3{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
}

}  // namespace

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

std::vector<Candidates::Pair> Candidates::PairsOf(std::size_t segment,
                                                  const std::vector<Eigen::Vector3d>& points_W,
                                                  const std::vector<CellOfCandidate>& index) const {
  // How many points are in or beside a cell of each candidate.
  std::vector<Index3> cells;
  cells.reserve(points_W.size());
  for (const Eigen::Vector3d& p_W : points_W) cells.push_back(FloorOf(p_W / cell_m_));
  std::sort(cells.begin(), cells.end());
  std::vector<std::size_t> near(candidates_.size());
  std::vector<std::size_t> last_group(candidates_.size());
  std::vector<Index3> own;  // each cell once
  for (std::size_t begin = 0; begin < cells.size();) {
    std::size_t end = begin;
    while (end < cells.size() && cells[end] == cells[begin]) ++end;
    own.push_back(cells[begin]);
    for (int i = 0; i < 27; ++i) {
      const Index3 beside = Beside(cells[begin], i);
      for (auto at = std::lower_bound(index.begin(), index.end(), CellOfCandidate{beside, 0});
           at != index.end() && at->cell == beside; ++at) {
        if (last_group[at->candidate] == end) continue;
        last_group[at->candidate] = end;
        near[at->candidate] += end - begin;
      }
    }
    begin = end;
  }
  std::vector<Pair> pairs;
  std::vector<Index3> reach;  // the segment's cells and those beside
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    const double share = static_cast<double>(near[c]) / static_cast<double>(points_W.size());
    if (share < config_.near_share) continue;
    if (reach.empty()) {
      for (const Index3& cell : own) {
        for (int i = 0; i < 27; ++i) reach.push_back(Beside(cell, i));
      }
      std::sort(reach.begin(), reach.end());
      reach.erase(std::unique(reach.begin(), reach.end()), reach.end());
    }
    // A large segment beside a small one is near all of it, but not the other way round.
    const std::vector<Index3>& others = candidates_[c].cells;
    const auto back = std::count_if(others.begin(), others.end(), [&](const Index3& cell) {
      return std::binary_search(reach.begin(), reach.end(), cell);
    });
    pairs.push_back(
        {share * static_cast<double>(back) / static_cast<double>(others.size()), segment, c});
  }
  if (pairs.size() > kMostPairs) {
    std::stable_sort(pairs.begin(), pairs.end(), OverlapsMore);
    pairs.resize(kMostPairs);
  }
  return pairs;
}

void Candidates::Forget(const std::function<bool(InstanceId)>& is_in_map) {
  std::erase_if(candidates_, [&](const Candidate& candidate) {
    return candidate.id != kNoInstance && is_in_map(candidate.id);
  });
}

std::vector<Candidates::Verdict> Candidates::Confirm(
    const std::vector<std::vector<Eigen::Vector3d>>& segments_W, const std::vector<bool>& may_begin,
    const std::vector<bool>& is_held, const std::function<InstanceId()>& new_id) {
  ++frame_;
  std::vector<CellOfCandidate> index;
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    for (const Index3& cell : candidates_[c].cells) index.push_back({cell, c});
  }
  std::sort(index.begin(), index.end());
  std::vector<Pair> pairs;
  std::vector<bool> is_large(segments_W.size());
  for (std::size_t s = 0; s < segments_W.size(); ++s) {
    is_large[s] = segments_W[s].size() >= static_cast<std::size_t>(config_.min_points);
    if (!is_large[s]) continue;
    const std::vector<Pair> of_segment = PairsOf(s, segments_W[s], index);
    pairs.insert(pairs.end(), of_segment.begin(), of_segment.end());
  }
  std::stable_sort(pairs.begin(), pairs.end(), OverlapsMore);
  std::vector<std::optional<std::size_t>> candidate_of(segments_W.size());
  std::vector<bool> is_taken(candidates_.size());
  for (const Pair& pair : pairs) {
    if (candidate_of[pair.segment] || is_taken[pair.candidate]) continue;
    candidate_of[pair.segment] = pair.candidate;
    is_taken[pair.candidate] = true;
  }

  std::vector<Verdict> verdicts(segments_W.size());
  std::vector<Candidate> left;
  auto named = static_cast<std::size_t>(std::ranges::count_if(
      candidates_, [](const Candidate& candidate) { return candidate.id != kNoInstance; }));
  std::size_t room = kMostCandidates - std::min(kMostCandidates, candidates_.size() - named);
  for (std::size_t s = 0; s < segments_W.size(); ++s) {
    if (!is_large[s]) continue;
    Candidate candidate;
    if (candidate_of[s]) {
      candidate = std::move(candidates_[*candidate_of[s]]);
    } else if (!may_begin[s] || room == 0) {
      continue;
    } else {
      --room;
      candidate.first = frame_;
    }
    if (may_begin[s]) candidate.seen.push_back(frame_);
    while (!candidate.seen.empty() && candidate.seen.front() <= frame_ - config_.confirm_window) {
      candidate.seen.pop_front();
    }
    const bool is_confirmed = may_begin[s] &&
                              static_cast<int>(candidate.seen.size()) >= config_.confirm_frames &&
                              (!is_held[s] || frame_ - candidate.first >= config_.hold_frames);
    const bool is_new = is_confirmed && candidate.id == kNoInstance;
    if (is_new) candidate.id = new_id();
    verdicts[s] =
        is_confirmed ? Verdict{Candidacy::kIsConfirmed, candidate.id} : Verdict{Candidacy::kWaits};
    if (is_new && candidate.id != kNoInstance && ++named > kMostCandidates) continue;
    candidate.cells = CellsOf(segments_W[s]);
    if (!IsOver(candidate)) left.push_back(std::move(candidate));
  }
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    if (!is_taken[c] && !IsOver(candidates_[c])) left.push_back(std::move(candidates_[c]));
  }
  candidates_ = std::move(left);
  return verdicts;
}

}  // namespace tsdfpp
