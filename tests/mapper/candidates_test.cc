// Segments that wait to become objects, against a plain version that looks at every pair of a
// segment and a candidate, and frames of very many segments.
#include "mapper/associate/candidates.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <random>
#include <set>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using Candidacy = Candidates::Candidacy;
using Verdict = Candidates::Verdict;
constexpr double kVoxel_m = 0.01;

// candidates.h's rules, with the points themselves in place of an index of cells.
class PlainCandidates {
 public:
  explicit PlainCandidates(const VoteConfig& config) : config_(config) {}

  void Forget(const std::function<bool(InstanceId)>& is_in_map) {
    std::vector<Candidate> left;
    for (const Candidate& candidate : candidates_) {
      if (candidate.id == kNoInstance || !is_in_map(candidate.id)) left.push_back(candidate);
    }
    candidates_ = left;
  }

  std::vector<Verdict> Confirm(const std::vector<Points>& segments_W,
                               const std::vector<bool>& may_begin, const std::vector<bool>& is_held,
                               const std::function<InstanceId()>& new_id) {
    ++frame_;
    struct Pair {
      double overlap;
      std::size_t segment;
      std::size_t candidate;
    };
    std::vector<Pair> pairs;
    for (std::size_t s = 0; s < segments_W.size(); ++s) {
      if (!IsLarge(segments_W[s])) continue;
      for (std::size_t c = 0; c < candidates_.size(); ++c) {
        const double share = ShareNear(segments_W[s], candidates_[c].points_W);
        if (share < config_.near_share) continue;
        const Points cells = OnePointACell(candidates_[c].points_W);
        pairs.push_back({share * ShareNear(cells, segments_W[s]), s, c});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.overlap > b.overlap; });
    std::map<std::size_t, std::size_t> candidate_of;
    std::set<std::size_t> taken;
    for (const Pair& pair : pairs) {
      if (candidate_of.contains(pair.segment) || taken.contains(pair.candidate)) continue;
      candidate_of[pair.segment] = pair.candidate;
      taken.insert(pair.candidate);
    }
    std::vector<Verdict> verdicts(segments_W.size());
    std::vector<Candidate> left;
    for (std::size_t s = 0; s < segments_W.size(); ++s) {
      if (!IsLarge(segments_W[s])) continue;
      if (!candidate_of.contains(s) && !may_begin[s]) continue;
      Candidate candidate;
      candidate.first = frame_;
      if (candidate_of.contains(s)) candidate = candidates_[candidate_of[s]];
      if (may_begin[s]) candidate.seen.push_back(frame_);
      candidate.points_W = segments_W[s];
      const bool is_confirmed =
          may_begin[s] &&
          SeenSince(candidate, frame_ - config_.confirm_window + 1) >= config_.confirm_frames &&
          (!is_held[s] || frame_ >= candidate.first + config_.hold_frames);
      verdicts[s].candidacy = is_confirmed ? Candidacy::kIsConfirmed : Candidacy::kWaits;
      if (is_confirmed && candidate.id == kNoInstance) candidate.id = new_id();
      if (is_confirmed) verdicts[s].id = candidate.id;
      if (IsInNextWindow(candidate)) left.push_back(candidate);
    }
    for (std::size_t c = 0; c < candidates_.size(); ++c) {
      if (taken.contains(c)) continue;
      if (IsInNextWindow(candidates_[c])) left.push_back(candidates_[c]);
    }
    candidates_ = left;
    return verdicts;
  }

  std::size_t size() const { return candidates_.size(); }

 private:
  struct Candidate {
    int first = 0;
    std::vector<int> seen;
    Points points_W;
    InstanceId id = kNoInstance;
  };
  bool IsLarge(const Points& points_W) const {
    return points_W.size() >= static_cast<std::size_t>(config_.min_points);
  }
  bool IsInNextWindow(const Candidate& candidate) const {
    const int first = frame_ + 1 - config_.confirm_window + 1;
    return SeenSince(candidate, std::min(first, frame_)) > 0;
  }
  static std::ptrdiff_t SeenSince(const Candidate& candidate, int frame) {
    return std::count_if(candidate.seen.begin(), candidate.seen.end(),
                         [&](int seen) { return seen >= frame; });
  }
  Index3 CellOf(const Eigen::Vector3d& p_W) const {
    return FloorOf(p_W / (0.5 * config_.near_voxels * kVoxel_m));
  }
  Points OnePointACell(const Points& points_W) const {
    std::map<Index3, Eigen::Vector3d> cells;
    for (const Eigen::Vector3d& p_W : points_W) cells.emplace(CellOf(p_W), p_W);
    Points points;
    for (const auto& [cell, p_W] : cells) points.push_back(p_W);
    return points;
  }
  double ShareNear(const Points& points_W, const Points& others_W) const {
    const auto near = std::count_if(points_W.begin(), points_W.end(), [&](const auto& p_W) {
      return std::any_of(others_W.begin(), others_W.end(), [&](const auto& other_W) {
        const Index3 a = CellOf(p_W);
        const Index3 b = CellOf(other_W);
        return std::abs(a.x - b.x) <= 1 && std::abs(a.y - b.y) <= 1 && std::abs(a.z - b.z) <= 1;
      });
    });
    return static_cast<double>(near) / static_cast<double>(points_W.size());
  }

  VoteConfig config_;
  int frame_ = 0;
  std::vector<Candidate> candidates_;
};

// Ids from 1 on; there is no last one.
class Ids {
 public:
  InstanceId operator()() { return ++last_; }

 private:
  InstanceId last_ = 0;
};

Candidacy CandidacyOf(Candidates& candidates, const Points& points, bool may_begin, bool is_held) {
  return candidates.Confirm({points}, {may_begin}, {is_held}, Ids()).front().candidacy;
}

class Clouds {
 public:
  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(dice_);
  }
  Points Around(const Eigen::Vector3d& centre_W, double radius_m, int count) {
    Points points;
    for (int i = 0; i < count; ++i) {
      points.push_back(centre_W +
                       radius_m * Eigen::Vector3d(Between(-1, 1), Between(-1, 1), Between(-1, 1)));
    }
    return points;
  }

 private:
  std::minstd_rand dice_{1};
};

TEST(Candidates, AreThoseOfPlainPairs) {
  VoteConfig config;
  config.min_points = 5;
  config.hold_frames = 6;
  Clouds clouds;
  for (int trial = 0; trial < 30; ++trial) {
    config.confirm_window = std::array{5, 1, 2}[static_cast<std::size_t>(trial % 3)];
    config.confirm_frames = std::min(3, config.confirm_window);
    Candidates candidates(config, kVoxel_m);
    PlainCandidates plain(config);
    Ids ids;
    Ids plain_ids;
    for (int frame = 0; frame < 12; ++frame) {
      std::vector<Points> segments_W;
      std::vector<bool> may_begin;
      std::vector<bool> is_held;
      const int count = static_cast<int>(clouds.Between(0, 10));
      for (int s = 0; s < count; ++s) {
        const Eigen::Vector3d centre_W(clouds.Between(0, 0.2), clouds.Between(0, 0.2), 1);
        segments_W.push_back(clouds.Around(centre_W, clouds.Between(0.01, 0.1),
                                           static_cast<int>(clouds.Between(3, 30))));
        may_begin.push_back(clouds.Between(0, 1) < 0.6);
        is_held.push_back(clouds.Between(0, 1) < 0.5);
      }
      SCOPED_TRACE(testing::Message() << "trial " << trial << ", frame " << frame);
      // The map has every third a frame later; the others are never fused.
      const auto is_in_map = [](InstanceId id) { return id % 3 == 0; };
      candidates.Forget(is_in_map);
      plain.Forget(is_in_map);
      ASSERT_EQ(candidates.Confirm(segments_W, may_begin, is_held, std::ref(ids)),
                plain.Confirm(segments_W, may_begin, is_held, std::ref(plain_ids)));
      ASSERT_EQ(candidates.size(), plain.size());
    }
  }
}

TEST(Candidates, AreHeldForSoManyFramesWhateverTheWindow) {
  Clouds clouds;
  VoteConfig config;
  config.confirm_frames = 1;
  config.hold_frames = 4;
  const Points points = clouds.Around({0, 0, 1}, 0.05, 2 * config.min_points);
  for (const int window : {1, 2, 5}) {
    SCOPED_TRACE(window);
    config.confirm_window = window;
    ASSERT_TRUE(config.Validate());
    Candidates candidates(config, kVoxel_m);
    for (int i = 0; i < config.hold_frames; ++i) {
      EXPECT_EQ(CandidacyOf(candidates, points, true, true), Candidacy::kWaits) << i;
    }
    EXPECT_EQ(CandidacyOf(candidates, points, true, true), Candidacy::kIsConfirmed);
    candidates.Forget([](InstanceId) { return true; });
    // Out of sight it is forgotten, and what may begin none is not counted.
    EXPECT_EQ(CandidacyOf(candidates, points, true, true), Candidacy::kWaits);
    EXPECT_EQ(CandidacyOf(candidates, points, false, true), Candidacy::kWaits);
    for (int i = 0; i < window; ++i) candidates.Confirm({}, {}, {}, Ids());
    EXPECT_EQ(candidates.size(), 0U);
  }
}

// One that was held, and is there once more in a frame in which its segment may begin nothing.
TEST(Candidates, AreNotConfirmedByWhatMayBeginNone) {
  Clouds clouds;
  const VoteConfig config;
  const Points points = clouds.Around({0, 0, 1}, 0.05, 2 * config.min_points);
  Candidates candidates(config, kVoxel_m);
  for (int i = 0; i < config.confirm_frames + 1; ++i) {
    EXPECT_EQ(CandidacyOf(candidates, points, true, true), Candidacy::kWaits) << i;
  }
  EXPECT_EQ(CandidacyOf(candidates, points, false, false), Candidacy::kWaits);
  EXPECT_EQ(CandidacyOf(candidates, points, true, false), Candidacy::kIsConfirmed);
}

// Of a segment too small for the tracker the map never has anything: it would be born again and
// again, until all ids were used up.
TEST(Candidates, KeepTheirIdUntilTheMapHasThem) {
  Clouds clouds;
  VoteConfig config;
  config.hold_frames = 0;
  const Points points = clouds.Around({0, 0, 1}, 0.05, 2 * config.min_points);
  Candidates candidates(config, kVoxel_m);
  Ids ids;
  const auto verdict = [&] {
    return candidates.Confirm({points}, {true}, {false}, std::ref(ids)).front();
  };
  for (int i = 1; i < config.confirm_frames; ++i) {
    EXPECT_EQ(verdict(), (Verdict{Candidacy::kWaits, kNoInstance})) << i;
  }
  for (int i = 0; i < 3 * config.confirm_window; ++i) {
    EXPECT_EQ(verdict(), (Verdict{Candidacy::kIsConfirmed, 1})) << i;
    candidates.Forget([](InstanceId) { return false; });
  }
  // Hidden for a frame it is the same, too.
  candidates.Confirm({}, {}, {}, std::ref(ids));
  EXPECT_EQ(verdict(), (Verdict{Candidacy::kIsConfirmed, 1}));
  // Beyond the window it is another.
  for (int i = 0; i < config.confirm_window; ++i) candidates.Confirm({}, {}, {}, std::ref(ids));
  EXPECT_EQ(verdict(), (Verdict{Candidacy::kWaits, kNoInstance}));
  for (int i = 1; i < config.confirm_frames; ++i) {
    EXPECT_EQ(verdict().id, i + 1 < config.confirm_frames ? kNoInstance : 2) << i;
  }
  // The map has it: what else is there begins anew.
  candidates.Forget([](InstanceId id) { return id == 2; });
  EXPECT_EQ(verdict(), (Verdict{Candidacy::kWaits, kNoInstance}));
}

// Time and memory would grow with the square of the segments, which are as many as a frame's masks
// have ids; those that find no place wait until others have become objects.
TEST(Candidates, VeryManySegmentsWaitForTheirTurn) {
  constexpr int kSegments = 5000;
  const VoteConfig config;
  Clouds clouds;
  Candidates candidates(config, kVoxel_m);
  std::vector<Points> segments_W;
  segments_W.reserve(kSegments);
  for (int s = 0; s < kSegments; ++s) {
    const int row = s / 100;
    segments_W.push_back(clouds.Around(Eigen::Vector3d(s % 100, row, 1), 0.02, 50));
  }
  Ids ids;
  std::size_t confirmed = 0;
  int frames = 0;
  while (!segments_W.empty() && frames < 100) {
    ++frames;
    const auto verdicts = candidates.Confirm(segments_W, std::vector<bool>(segments_W.size(), true),
                                             std::vector<bool>(segments_W.size()), std::ref(ids));
    ASSERT_LE(candidates.size(), 2 * Candidates::kMostCandidates);
    std::vector<Points> rest;
    for (std::size_t s = 0; s < segments_W.size(); ++s) {
      if (verdicts[s].candidacy == Candidacy::kIsConfirmed)
        ++confirmed;
      else
        rest.push_back(segments_W[s]);
    }
    segments_W = rest;
  }
  EXPECT_EQ(confirmed, std::size_t{kSegments});
  EXPECT_LE(frames, 30);
}

// All at one place, each of which could be any candidate.
TEST(Candidates, VeryManySegmentsAtOnePlaceAreBounded) {
  const VoteConfig config;
  Clouds clouds;
  Candidates candidates(config, kVoxel_m);
  std::vector<Points> segments_W(6000, clouds.Around({0, 0, 1}, 0.02, 50));
  for (int frame = 1; frame < config.confirm_frames; ++frame) {
    for (const Verdict& verdict :
         candidates.Confirm(segments_W, std::vector<bool>(segments_W.size(), true),
                            std::vector<bool>(segments_W.size()), Ids())) {
      ASSERT_NE(verdict.candidacy, Candidacy::kIsConfirmed);
    }
    EXPECT_EQ(candidates.size(), Candidates::kMostCandidates);
  }
}

}  // namespace
}  // namespace tsdfpp
