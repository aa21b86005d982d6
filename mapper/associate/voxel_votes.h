// Segments whose ids are of one frame alone, matched to the map's objects by the votes of their
// points (paper III-C).
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "mapper/associate/associator.h"
#include "mapper/associate/candidates.h"
#include "mapper/associate/object_lookup.h"
#include "mapper/associate/vote_config.h"

namespace tsdfpp {

class VoxelVotes : public Associator {
 public:
  // New objects get ids from `first_id` on, above all that the map has had. The config must be
  // valid.
  explicit VoxelVotes(const VoteConfig& config, InstanceId first_id = 1);

  // In this order:
  //  1. *Votes.* Each point of a segment (a pixel with valid depth, taken through the camera's
  //     pose) votes for the object to whose surface, at its last pose, it is nearest, if that is
  //     within at_voxels.
  //  2. *Claims.* A segment joins the object that most of its points vote for, if those are
  //     min_share of them; several may join one object.
  //     Segments that are unknown (Segments::unknown) may be pieces of the background, of which
  //     those at an object's foot are near both; taken once, they would take their neighbours. So
  //     points of theirs do not vote where they are nearer to the background's surface, count for
  //     no claim (of 2 and 3) where they are within at_voxels of it, and are nobody's where they
  //     are nearer to it than to the object that the segment joins.
  //     Of a known segment that has joined one, the part that is far from it (FindFarPart(),
  //     far_share) is a segment of its own, with votes and a claim of its own. What is far votes
  //     for the object no more, here and below: it voted for stray voxels.
  //  3. *Moved objects.* Of the segments that are left and the objects that have none and had one
  //     at most recent_frames frames ago, those belong together of which the greatest share of
  //     points, and near_share at least, is within near_voxels of the object; one segment an
  //     object.
  //  4. *Cuts.* Where cut_share of a claimed segment's points vote for another object that has no
  //     segment, the mask has merged the two: each pixel is then the nearest one's of those, and
  //     nobody's beyond near_voxels. (Of an unknown segment also where it is nearer to the
  //     background.)
  //  5. *Births.* What is left is held back (kNoInstance: not fused, so that nothing of a false
  //     segment enters the map) until Candidates confirm it, and then a new object. One that may be
  //     an object that is missing (ExpectReturns()) is held back until it is found to be that
  //     (mapper/track/lost_objects.h), for hold_frames frames at most. Ids count up and are never
  //     used again; after the last one, kNoInstance - 1, nothing is born any more, and Remarks()
  //     says so. One of which nothing was fused yet is the same object in the next frame.
  //     Unknown segments and far parts may be the candidate that a known one was before, which
  //     waits on, but begin none. Else, if they are unknown, they are background, or held back
  //     where cut_share of their points vote for one object.
  // The background (id 0 of the segments) stays the background. Ties go to the lower id. A frame
  // whose segments say nothing at all counts for nothing.
  AssociatedObjects Associate(const Frame& frame, const Segments& segments,
                              const MapRepresentation& map) override;

  void ExpectReturns(const MayBeMissing& may_be) override { may_be_missing_ = may_be; }

  void Found(InstanceId id) override { next_.last_seen[id] = next_.frame; }

  void Accept() override { state_ = next_; }

  std::vector<std::string> Remarks() const override;

 private:
  // What a segment's points say of an object.
  struct Votes {
    std::size_t object = 0;  // of ObjectLookup::ids()
    int at = 0;              // votes
    int alone = 0;           // of them, those that count for a claim
    int near = 0;            // points within near_voxels, that count for a claim
  };

  // A segment of the frame, and what becomes of it.
  struct Segment {
    InstanceId id = kNoInstance;            // in the frame's segments
    bool is_known = true;                   // not one of Segments::unknown
    bool is_far_part = false;               // of another segment, whose id it has
    std::vector<int> pixels;                // with valid depth, by rows
    std::vector<Eigen::Vector3d> points_W;  // of them, thinned
    std::vector<Votes> votes;               // of objects that got any, by ObjectLookup::ids()
    std::optional<std::size_t> object;      // by ObjectLookup::ids()
    std::optional<std::size_t> far_from;    // the object whose far part it is, which gets no votes
    std::vector<std::size_t> shared_with;   // objects to be cut off
    InstanceId label = kNoInstance;
  };

  void TakePoints(const Frame& frame, double voxel_m, Segment& segment) const;
  std::vector<Segment> FindSegments(const Frame& frame, const Segments& segments,
                                    double voxel_m) const;
  void CountVotes(const ObjectLookup& lookup, Segment& segment) const;
  // Whom it joins, by its votes.
  void Join(Segment& segment) const;
  void Claim(const ObjectLookup& lookup, std::span<Segment> segments) const;
  void SplitFarParts(const Frame& frame, const cv::Mat& ids, const ObjectLookup& lookup,
                     double voxel_m, std::vector<Segment>& segments) const;
  void ClaimMoved(const ObjectLookup& lookup, std::vector<Segment>& segments) const;
  void FindCuts(const ObjectLookup& lookup, std::vector<Segment>& segments) const;
  // Whether cut_share of its points vote for one object.
  bool IsPartlyAnObject(const Segment& segment) const;
  void GiveBirth(const ObjectLookup& lookup, std::vector<Segment>& segments, double voxel_m);
  // The objects without a segment.
  static std::vector<InstanceId> UnseenOf(const ObjectLookup& lookup,
                                          const std::vector<Segment>& segments);
  // Gives the pixels of a claimed segment to those that share it, and takes from an unknown one
  // what is the background's.
  void Cut(const Frame& frame, const ObjectLookup& lookup, const Segment& segment,
           cv::Mat& labels) const;

  // What is remembered from frame to frame.
  struct State {
    int next_id = 1;
    bool refused_birth = false;
    int frame = 0;                        // counted here
    std::map<InstanceId, int> last_seen;  // the frame in which an object had a segment
    std::optional<Candidates> candidates;
  };

  VoteConfig config_;
  MayBeMissing may_be_missing_;
  State state_;  // after the frame accepted last
  State next_;   // after the frame associated last
};

}  // namespace tsdfpp
