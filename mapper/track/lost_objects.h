// Objects that are not where the map has them: kept apart until a segment is found to be theirs.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "mapper/associate/associator.h"
#include "mapper/map_representation.h"
#include "mapper/track/appearance.h"
#include "mapper/track/model_search.h"
#include "mapper/track/sdf_track_config.h"
#include "mapper/track/segment_look.h"
#include "mapper/track/tracker.h"

namespace tsdfpp {

class LostObjects {
 public:
  // The config must be valid.
  explicit LostObjects(const SdfTrackConfig& config) : config_(config) {}

  // Of the objects with a pose in `T_WO_asked`: those that the frame shows not to be where the map
  // has them. What `loose` segments show is not that object in its place. Of a map with volumes.
  std::vector<InstanceId> NotInPlace(const Frame& frame, const MapRepresentation& map,
                                     const ObjectPoses& T_WO_asked,
                                     std::span<const LoosePixels> loose) const;

  // Keeps the object's volume, as the map has it, and has.
  void Keep(InstanceId id, const MapRepresentation& map, const Pose& T_WO);

  // Of the objects with a pose in `T_WO`, by the pixels that are theirs: keeps those that were
  // found, and since then were frozen in return_frames frames and registered in none. Their place
  // was wrong, or their model is, and FindAgain() begins them anew where they are. Those whose
  // segment is too small, or at the picture's edge, are left.
  void GiveUpUnsure(const Frame& frame, const std::map<InstanceId, LoosePixels>& pixels_of,
                    const MapRepresentation& map, const ObjectPoses& T_WO);
  // What became of the objects in a frame (TrackedPoses::seen).
  void Watch(const std::map<InstanceId, TrackStatus>& seen);

  // Ends a frame: of those found then (FindAgain()) nothing is kept any more, but for those that
  // begin anew, until they have been seen in return_frames frames; the others are taken out of the
  // map and of `T_WO`. One that is lost before it has been seen in so many is kept as it was before
  // it began anew.
  std::vector<InstanceId> TakeOut(const std::vector<InstanceId>& found, MapRepresentation& map,
                                  ObjectPoses& T_WO);
  // Of those that began anew, by the pixels that are theirs: keeps those as they were before of
  // which FindModel() is certain now, so that FindAgain() finds them. Looks at every third frame,
  // at eight objects at most, of which FindAgain() looks for so many fewer.
  void AskTrials(const Frame& frame, const std::map<InstanceId, LoosePixels>& pixels_of);
  // Of those that began anew: takes out of the map and of `T_WO`, and keeps as they were before,
  // those that were out of sight in return_frames frames before they were seen in as many. What
  // they began on was not theirs, or was seen too little. `seen` is TrackedPoses::seen of a frame
  // with labels.
  std::vector<InstanceId> TakeBack(const std::map<InstanceId, TrackStatus>& seen,
                                   MapRepresentation& map, ObjectPoses& T_WO);
  // Undoes PutBack() and, for those that the map had, Keep().
  void Undo(const std::vector<InstanceId>& found, MapRepresentation& map, ObjectPoses& T_WO);

  bool empty() const { return kept_.empty(); }
  bool Has(InstanceId id) const { return kept_.contains(id); }
  std::vector<InstanceId> Ids() const;
  // Of one that is kept: whether it was lost in this frame, and the map still has it.
  bool IsInMap(InstanceId id) const { return kept_.at(id).is_in_map; }
  // Whether it was not known where it is: not of those that are kept by GiveUpUnsure() or
  // AskTrials().
  bool IsMissing(InstanceId id) const { return kept_.at(id).is_missing; }

  // Whether a segment of the frame may be one of the kept objects, or one of those of the map that
  // the frame does not show: it has some of their colours, and about their size where it is seen
  // whole. To be asked while frame, map and this are as they are.
  Associator::MayBeMissing Awaited(const Frame& frame, const MapRepresentation& map) const;

  // A segment of the frame.
  struct Segment {
    LoosePixels pixels;
    InstanceId id = kNoInstance;  // the kept object that it is, or it is to be found
    bool may_begin = true;        // a model may begin with it
    bool is_known = true;         // it is no piece of what nobody knows
  };
  // A segment that is a kept object's.
  struct Return {
    InstanceId id = kNoInstance;
    std::size_t segment = 0;
    Pose T_WO = Pose::Identity();
    // Nothing says where the segment is on the model, but it has been there for return_frames
    // frames: the model is to be begun anew, at the best place that there is.
    bool begins_anew = false;
    PlacedModel model = PlacedModel::kOther;
  };
  // Which of the segments are whose. A segment is an object's where FindModel() is certain of its
  // place. Where it is not, but the segment may begin a model, and looks like the object and like
  // no other that is missing, the object waits for return_frames frames in which such a segment is
  // in sight, twice as many where something covers it. A segment at the picture's edge is left
  // alone. Looks for an object in every third of the frames that have a segment that is like it,
  // for eight at most in a frame; the others have their turn in the next ones.
  std::vector<Return> FindAgain(const Frame& frame, std::span<const Segment> segments);

  // Puts a kept object where it was found, into the map and `T_WO`; one that begins anew into
  // `T_WO` alone. Errors: MapEditing::Add's.
  Expected<void> PutBack(const Return& found, MapRepresentation& map, ObjectPoses& T_WO) const;

 private:
  struct Kept {
    TsdfGrid volume;
    Appearance appearance;
    Pose T_WL = Pose::Identity();
    Pose T_WO = Pose::Identity();
    double voxel_m = 0;
    bool is_in_map = true;
    int frames_asked = 0;      // in which something was like it
    int frames_in_sight = 0;   // and might have begun a model
    bool is_given_up = false;  // the model is
    bool is_missing = true;
    PlacedModel model = PlacedModel::kSame;  // that it has here, once it is put back
  };
  // Begins anew where it is not certain; where nothing is found, too, turned as it was last.
  Return Find(InstanceId id, const Kept& kept, const Frame& frame, const LoosePixels& pixels,
              const SegmentLook& look, std::size_t segment) const;

  // Its kept object, from now on one that the map does not have.
  void KeepAsItWas(InstanceId id, const Kept& kept);

  SdfTrackConfig config_;
  std::map<InstanceId, Kept> kept_;
  // Those that were found and not registered since, with the frames in which they were frozen.
  std::map<InstanceId, int> unsure_;
  // Those that began anew, as they were before.
  struct Trial {
    Kept before;
    int frames_seen = 0;
    int frames_unseen = 0;
  };
  std::map<InstanceId, Trial> on_trial_;
  InstanceId last_trial_ = 0;  // that was searched for
  // Those that AskTrials() keeps, and where it found them, until FindAgain() has.
  struct Recalled {
    Trial trial;
    Return found;
  };
  std::map<InstanceId, Recalled> recalled_;
  int searches_ = 0;  // in this frame
};

}  // namespace tsdfpp
