#include "mapper/associate/voxel_votes.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

#include "core/pixel_ray.h"
#include "mapper/associate/far_part.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kIds = std::size_t{kNoInstance} + 1;
// No voxel is farther out.
constexpr double kFarthest_voxels = double{kBlockSide} * (kFurthestBlock + 1);

Eigen::Vector3d PointOf(const Frame& frame, int pixel) {
  const int v = pixel / frame.depth.cols;
  const int u = pixel % frame.depth.cols;
  const double z = frame.depth.at<float>(v, u);
  return frame.T_WC * (z * PixelRay(frame.intrinsics, u, v));
}

// A step in depth that parts two surfaces: what is seen at a flat angle has smaller ones.
constexpr double kStep_voxels = 4;

constexpr float kFar = std::numeric_limits<float>::infinity();

// To the surface of one object (of ObjectLookup::ids()), voxels; kFar where it says nothing.
// `scratch` is what memory is kept in from call to call.
float DistanceOf(const ObjectLookup& lookup, std::size_t object, const Eigen::Vector3d& p_W,
                 std::vector<ObjectLookup::Distance>& scratch) {
  lookup.Distances(p_W, std::span(&object, 1), scratch);
  return scratch.empty() ? kFar : scratch.front().voxels;
}

bool IsShare(int count, double share, std::size_t of) {
  return count > 0 && count >= share * static_cast<double>(of);
}

}  // namespace

VoxelVotes::VoxelVotes(const VoteConfig& config, InstanceId first_id) : config_(config) {
  state_.next_id = first_id;
}

void VoxelVotes::TakePoints(const Frame& frame, double voxel_m, Segment& segment) const {
  segment.points_W.clear();
  const std::size_t all = segment.pixels.size();
  const std::size_t count = std::min(all, static_cast<std::size_t>(config_.max_points));
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d p_W = PointOf(frame, segment.pixels[i * all / count]);
    // Beyond all voxels: CheckReach() refuses the frame, or the segment is of no use.
    if (!(p_W.cwiseAbs().maxCoeff() < kFarthest_voxels * voxel_m)) continue;
    segment.points_W.push_back(p_W);
  }
}

std::vector<VoxelVotes::Segment> VoxelVotes::FindSegments(const Frame& frame,
                                                          const Segments& segments,
                                                          double voxel_m) const {
  const cv::Mat& ids = segments.ids;
  std::vector<std::vector<int>> pixels(kIds);
  std::vector<bool> is_there(kIds);
  for (int v = 0; v < ids.rows; ++v) {
    const auto* row = ids.ptr<InstanceId>(v);
    const auto* depth = frame.depth.ptr<float>(v);
    for (int u = 0; u < ids.cols; ++u) {
      if (row[u] == kBackground || row[u] == kNoInstance) continue;
      is_there[row[u]] = true;
      if (IsValidDepth(depth[u])) pixels[row[u]].push_back(v * ids.cols + u);
    }
  }
  std::vector<Segment> found;
  for (std::size_t id = 0; id < kIds; ++id) {
    if (!is_there[id]) continue;
    Segment segment;
    segment.id = static_cast<InstanceId>(id);
    segment.is_known =
        !std::binary_search(segments.unknown.begin(), segments.unknown.end(), segment.id);
    segment.pixels = std::move(pixels[id]);
    TakePoints(frame, voxel_m, segment);
    found.push_back(std::move(segment));
  }
  return found;
}

void VoxelVotes::CountVotes(const ObjectLookup& lookup, Segment& segment) const {
  const std::optional<std::size_t> background = lookup.NumberOf(kBackground);
  const bool may_be_background = !segment.is_known && background;
  std::vector<std::size_t> around = lookup.Around(segment.points_W);
  if (background) std::erase(around, *background);
  if (segment.far_from) std::erase(around, *segment.far_from);
  if (around.empty()) return;
  std::vector<Votes> counts(around.size());
  for (std::size_t i = 0; i < around.size(); ++i) counts[i].object = around[i];
  std::vector<ObjectLookup::Distance> distances;
  std::vector<ObjectLookup::Distance> scratch;
  for (const Eigen::Vector3d& p_W : segment.points_W) {
    lookup.Distances(p_W, around, distances);
    if (distances.empty()) continue;
    const float to_background =
        may_be_background ? DistanceOf(lookup, *background, p_W, scratch) : kFar;
    const bool is_alone = to_background > config_.at_voxels;
    Votes* nearest = nullptr;
    float least = 0;
    for (const ObjectLookup::Distance& distance : distances) {
      const auto place =
          std::lower_bound(around.begin(), around.end(), distance.object) - around.begin();
      Votes& votes = counts[static_cast<std::size_t>(place)];
      if (is_alone && distance.voxels <= config_.near_voxels) ++votes.near;
      if (nearest == nullptr ? distance.voxels <= config_.at_voxels : distance.voxels < least) {
        nearest = &votes;
        least = distance.voxels;
      }
    }
    if (nearest == nullptr || to_background < least) continue;
    ++nearest->at;
    if (is_alone) ++nearest->alone;
  }
  for (const Votes& votes : counts) {
    if (votes.at > 0 || votes.near > 0) segment.votes.push_back(votes);
  }
}

void VoxelVotes::Join(Segment& segment) const {
  const auto most =
      std::max_element(segment.votes.begin(), segment.votes.end(),
                       [](const Votes& a, const Votes& b) { return a.alone < b.alone; });
  if (most == segment.votes.end()) return;
  if (IsShare(most->alone, config_.min_share, segment.points_W.size())) {
    segment.object = most->object;
  }
}

void VoxelVotes::Claim(const ObjectLookup& lookup, std::span<Segment> segments) const {
  tbb::parallel_for(std::size_t{0}, segments.size(), [&](std::size_t s) {
    CountVotes(lookup, segments[s]);
    Join(segments[s]);
  });
}

void VoxelVotes::SplitFarParts(const Frame& frame, const cv::Mat& ids, const ObjectLookup& lookup,
                               double voxel_m, std::vector<Segment>& segments) const {
  if (config_.far_share <= 0) return;
  const FarPartConfig config{.share = config_.far_share,
                             .least_m = config_.near_voxels * voxel_m,
                             .step_m = std::max(FarPartConfig{}.step_m, kStep_voxels * voxel_m),
                             .least_pixels = config_.min_points};
  std::vector<std::size_t> joined;
  for (const Segment& segment : segments) {
    if (segment.is_known && segment.object) joined.push_back(*segment.object);
  }
  std::ranges::sort(joined);
  joined.erase(std::unique(joined.begin(), joined.end()), joined.end());
  const std::vector<ObjectLookup::SurfaceBox> boxes = lookup.BoxesOfSurfaces(joined);
  std::vector<std::vector<int>> far(segments.size());
  tbb::parallel_for(std::size_t{0}, segments.size(), [&](std::size_t s) {
    const Segment& segment = segments[s];
    if (!segment.is_known || !segment.object) return;
    const auto place = std::ranges::lower_bound(joined, *segment.object) - joined.begin();
    far[s] =
        FindFarPart(frame, ids, segment.pixels, boxes[static_cast<std::size_t>(place)], config);
  });
  const std::size_t wholes = segments.size();
  for (std::size_t s = 0; s < wholes; ++s) {
    if (far[s].empty()) continue;
    if (far[s].size() == segments[s].pixels.size()) {
      segments[s].far_from = std::exchange(segments[s].object, std::nullopt);
      segments[s].votes.clear();
      Claim(lookup, {&segments[s], 1});
      continue;
    }
    std::vector<int> rest;
    std::ranges::set_difference(segments[s].pixels, far[s], std::back_inserter(rest));
    segments[s].pixels = std::move(rest);
    TakePoints(frame, voxel_m, segments[s]);
    segments[s].votes.clear();
    CountVotes(lookup, segments[s]);
    Segment part;
    part.id = segments[s].id;
    part.is_far_part = true;
    part.far_from = segments[s].object;
    part.pixels = std::move(far[s]);
    TakePoints(frame, voxel_m, part);
    segments.push_back(std::move(part));
  }
  Claim(lookup, std::span(segments).subspan(wholes));
}

void VoxelVotes::ClaimMoved(const ObjectLookup& lookup, std::vector<Segment>& segments) const {
  struct Pair {
    double share;
    Segment* segment;
    std::size_t object;
  };
  std::vector<bool> has_segment(lookup.ids().size());
  for (const Segment& segment : segments) {
    if (segment.object) has_segment[*segment.object] = true;
  }
  std::vector<Pair> pairs;
  for (Segment& segment : segments) {
    if (segment.object) continue;
    for (const Votes& votes : segment.votes) {
      const auto seen = next_.last_seen.find(lookup.ids()[votes.object]);
      const bool is_recent =
          seen != next_.last_seen.end() && seen->second >= next_.frame - config_.recent_frames;
      if (has_segment[votes.object] || !is_recent) continue;
      if (!IsShare(votes.near, config_.near_share, segment.points_W.size())) continue;
      pairs.push_back(
          {static_cast<double>(votes.near) / static_cast<double>(segment.points_W.size()), &segment,
           votes.object});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.share > b.share; });
  for (const Pair& pair : pairs) {
    if (pair.segment->object || has_segment[pair.object]) continue;
    pair.segment->object = pair.object;
    has_segment[pair.object] = true;
  }
}

void VoxelVotes::FindCuts(const ObjectLookup& lookup, std::vector<Segment>& segments) const {
  std::vector<bool> has_segment(lookup.ids().size());
  for (const Segment& segment : segments) {
    // A far part is of the mask that may have to be cut.
    if (segment.object && !segment.is_far_part) has_segment[*segment.object] = true;
  }
  for (Segment& segment : segments) {
    if (!segment.object) continue;
    for (const Votes& votes : segment.votes) {
      if (has_segment[votes.object] ||
          !IsShare(votes.at, config_.cut_share, segment.points_W.size())) {
        continue;
      }
      segment.shared_with.push_back(votes.object);
    }
  }
}

bool VoxelVotes::IsPartlyAnObject(const Segment& segment) const {
  return std::any_of(segment.votes.begin(), segment.votes.end(), [&](const Votes& votes) {
    return IsShare(votes.at, config_.cut_share, segment.points_W.size());
  });
}

std::vector<InstanceId> VoxelVotes::UnseenOf(const ObjectLookup& lookup,
                                             const std::vector<Segment>& segments) {
  std::vector<bool> is_seen(lookup.ids().size());
  for (const Segment& segment : segments) {
    if (segment.object) is_seen[*segment.object] = true;
    for (const std::size_t object : segment.shared_with) is_seen[object] = true;
  }
  std::vector<InstanceId> unseen;
  for (std::size_t i = 0; i < is_seen.size(); ++i) {
    if (!is_seen[i] && lookup.ids()[i] != kBackground) unseen.push_back(lookup.ids()[i]);
  }
  return unseen;
}

void VoxelVotes::GiveBirth(const ObjectLookup& lookup, std::vector<Segment>& segments,
                           double voxel_m) {
  const std::vector<InstanceId> unseen = UnseenOf(lookup, segments);

  std::vector<Segment*> unclaimed;
  std::vector<std::vector<Eigen::Vector3d>> points_W;
  std::vector<bool> may_begin;
  std::vector<bool> is_held;
  for (Segment& segment : segments) {
    if (segment.object || segment.points_W.empty()) continue;
    unclaimed.push_back(&segment);
    points_W.push_back(segment.points_W);
    may_begin.push_back(segment.is_known && !segment.is_far_part);
    is_held.push_back(may_begin.back() && may_be_missing_ &&
                      may_be_missing_(segment.pixels, unseen));
  }
  if (!next_.candidates) next_.candidates.emplace(config_, voxel_m);
  using enum Candidates::Candidacy;
  next_.candidates->Forget([&](InstanceId id) { return lookup.NumberOf(id).has_value(); });
  const auto verdicts = next_.candidates->Confirm(points_W, may_begin, is_held, [&] {
    if (next_.next_id < kNoInstance) return static_cast<InstanceId>(next_.next_id++);
    next_.refused_birth = true;
    return kNoInstance;
  });
  for (std::size_t i = 0; i < unclaimed.size(); ++i) {
    if (verdicts[i].candidacy == kIsConfirmed) unclaimed[i]->label = verdicts[i].id;
    if (verdicts[i].candidacy == kNone && !unclaimed[i]->is_known &&
        !IsPartlyAnObject(*unclaimed[i])) {
      unclaimed[i]->label = kBackground;
    }
  }
}

void VoxelVotes::Cut(const Frame& frame, const ObjectLookup& lookup, const Segment& segment,
                     cv::Mat& labels) const {
  std::vector<std::size_t> sharers = segment.shared_with;
  sharers.push_back(*segment.object);
  std::sort(sharers.begin(), sharers.end());
  const std::optional<std::size_t> background =
      segment.is_known ? std::nullopt : lookup.NumberOf(kBackground);
  const bool is_cut = !segment.shared_with.empty();
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, segment.pixels.size()),
      [&](const tbb::blocked_range<std::size_t>& range) {
        std::vector<ObjectLookup::Distance> distances;
        std::vector<ObjectLookup::Distance> scratch;
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const int pixel = segment.pixels[i];
          const Eigen::Vector3d p_W = PointOf(frame, pixel);
          lookup.Distances(p_W, sharers, distances);
          const auto nearest =
              std::min_element(distances.begin(), distances.end(),
                               [](const auto& a, const auto& b) { return a.voxels < b.voxels; });
          const float least = nearest == distances.end() ? kFar : nearest->voxels;
          InstanceId& label = labels.at<InstanceId>(pixel / labels.cols, pixel % labels.cols);
          if (is_cut) {
            label = least <= config_.near_voxels ? lookup.ids()[nearest->object] : kNoInstance;
          }
          if (background && DistanceOf(lookup, *background, p_W, scratch) < least) {
            label = kNoInstance;
          }
        }
      });
}

AssociatedObjects VoxelVotes::Associate(const Frame& frame, const Segments& segments,
                                        const MapRepresentation& map) {
  next_ = state_;
  if (!SaysWhatIsWhere(segments.ids)) return {.labels = segments.ids.clone()};
  ++next_.frame;
  const ObjectLookup lookup(map, segments.unknown.empty()
                                     ? ObjectLookup::Of::kObjects
                                     : ObjectLookup::Of::kObjectsAndBackground);
  if (!lookup.ids().empty()) next_.next_id = std::max(next_.next_id, lookup.ids().back() + 1);
  std::vector<Segment> found = FindSegments(frame, segments, map.config().voxel_m);
  Claim(lookup, found);
  SplitFarParts(frame, segments.ids, lookup, map.config().voxel_m, found);
  ClaimMoved(lookup, found);
  FindCuts(lookup, found);
  GiveBirth(lookup, found, map.config().voxel_m);

  AssociatedObjects association;
  std::vector<InstanceId> label_of(kIds, kNoInstance);
  label_of[kBackground] = kBackground;
  for (Segment& segment : found) {
    if (segment.object) segment.label = lookup.ids()[*segment.object];
    if (!segment.is_far_part) label_of[segment.id] = segment.label;
    if (segment.label == kNoInstance || segment.label == kBackground) continue;
    next_.last_seen[segment.label] = next_.frame;
    const auto named = segments.classes.find(segment.id);
    if (!segment.is_far_part && named != segments.classes.end()) {
      association.classes.emplace(segment.label, named->second);
    }
  }
  association.labels.create(segments.ids.size(), CV_16UC1);
  for (int v = 0; v < segments.ids.rows; ++v) {
    const auto* from = segments.ids.ptr<InstanceId>(v);
    auto* to = association.labels.ptr<InstanceId>(v);
    for (int u = 0; u < segments.ids.cols; ++u) to[u] = label_of[from[u]];
  }
  for (const Segment& segment : found) {
    if (!segment.is_far_part) continue;
    for (const int pixel : segment.pixels) {
      association.labels.at<InstanceId>(pixel / segments.ids.cols, pixel % segments.ids.cols) =
          segment.label;
    }
  }
  for (Segment& segment : found) {
    const bool is_born = segment.label != kNoInstance && segment.label != kBackground;
    if (is_born) continue;
    association.unclaimed.push_back(std::move(segment.pixels));
    association.may_begin.push_back(segment.is_known && !segment.is_far_part);
    association.is_known.push_back(segment.is_known);
  }
  for (const Segment& segment : found) {
    if (!segment.object || (segment.is_known && segment.shared_with.empty())) continue;
    Cut(frame, lookup, segment, association.labels);
    for (const std::size_t o : segment.shared_with) {
      next_.last_seen[lookup.ids()[o]] = next_.frame;
    }
  }
  return association;
}

std::vector<std::string> VoxelVotes::Remarks() const {
  if (!state_.refused_birth) return {};
  return {fmt::format(
      "all {} ids of objects are used up, so segments of further ones were left out of the map",
      kNoInstance - 1)};
}

}  // namespace tsdfpp
