// Segments that no object of the map claims, until they have been there long enough to be one, and
// the map has it.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

#include "core/types.h"
#include "mapper/associate/vote_config.h"
#include "mapper/volume/block_grid.h"

namespace tsdfpp {

// Candidates are not in the map, so the points that a candidate showed last stand for it. Space is
// divided into cells of half of near_voxels. A segment can be a candidate if near_share of its
// points are in a cell of that one's points, or in one beside it.
class Candidates {
 public:
  // Far more than a scene shows at a time: they bound what a frame of very many segments costs.
  // So many wait, and so many have an id.
  static constexpr std::size_t kMostCandidates = 1000;
  static constexpr std::size_t kMostPairs = 16;

  // The config must be valid.
  Candidates(const VoteConfig& config, double voxel_m);

  // What a segment is.
  enum class Candidacy {
    kNone,         // too small, or it may begin none and is none
    kWaits,        // a candidate
    kIsConfirmed,  // it was one for long enough, and is an object from now on
  };
  struct Verdict {
    Candidacy candidacy = Candidacy::kNone;
    InstanceId id = kNoInstance;  // of who is confirmed
    bool operator==(const Verdict&) const = default;
  };

  // Forgets those that have become objects that the map has.
  void Forget(const std::function<bool(InstanceId)>& is_in_map);

  // Takes in the unclaimed segments of the next frame, each the points that it shows in the world's
  // frame, and whether it may begin a candidate; the others can but be one that there is, which
  // waits on, and are not counted. Says what each is. It is confirmed where it and its candidate
  // were there, with min_points or more, in confirm_frames of the last confirm_window frames, but
  // if it is held, not in the hold_frames frames from that on in which it was first there.
  // Who is confirmed gets an id of `new_id` (kNoInstance: there is none), and stays a candidate
  // that has this id: its segment may be too small to be fused, and then the map has no object that
  // claims it in the next frame, in which it would be born once more. While kMostCandidates have
  // one, a further one is forgotten.
  // Who cannot be confirmed any more is forgotten: whom the next frame's window does not reach back
  // to, but for who was there in this frame. A candidate is one segment of a frame at most: pairs
  // with the greatest overlap (that share times the share of the candidate's cells that are near
  // the segment's) are made first, and of a segment's only the kMostPairs greatest are looked at.
  // While kMostCandidates wait, no segment becomes a further one.
  std::vector<Verdict> Confirm(const std::vector<std::vector<Eigen::Vector3d>>& segments_W,
                               const std::vector<bool>& may_begin, const std::vector<bool>& is_held,
                               const std::function<InstanceId()>& new_id);

  std::size_t size() const { return candidates_.size(); }

 private:
  struct Candidate {
    int first = 0;                // the frame that it was first there
    std::deque<int> seen;         // frames, within the window
    std::vector<Index3> cells;    // of the points that it showed last, sorted
    InstanceId id = kNoInstance;  // once it was confirmed
  };
  struct CellOfCandidate {
    Index3 cell;
    std::size_t candidate = 0;
    bool operator<(const CellOfCandidate& other) const {
      return cell == other.cell ? candidate < other.candidate : cell < other.cell;
    }
  };
  struct Pair {
    double overlap = 0;
    std::size_t segment = 0;
    std::size_t candidate = 0;
  };
  static bool OverlapsMore(const Pair& a, const Pair& b) { return a.overlap > b.overlap; }
  // Whether the next frame's window does not reach back to it. A window of one frame reaches back
  // to none: it is then over where this frame did not show it.
  bool IsOver(const Candidate& candidate) const {
    const int window = std::max(config_.confirm_window, 2);
    return candidate.seen.empty() || candidate.seen.back() <= frame_ - window + 1;
  }
  std::vector<Index3> CellsOf(const std::vector<Eigen::Vector3d>& points_W) const;
  // The candidates that a segment can be, at most kMostPairs; `index` has all cells, sorted.
  std::vector<Pair> PairsOf(std::size_t segment, const std::vector<Eigen::Vector3d>& points_W,
                            const std::vector<CellOfCandidate>& index) const;

  VoteConfig config_;
  double cell_m_;
  int frame_ = 0;  // counted here
  std::vector<Candidate> candidates_;
};

}  // namespace tsdfpp
