// Objects that are not where they were last seen, and where they are now is not known: carried out
// of the picture, say. Their volumes are kept apart from the map, in which what is seen at the old
// place would clear them, until a segment fits one (docs/tracking.md, "Loss and return").
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "mapper/track/object_model.h"
#include "mapper/track/sdf_track_config.h"
#include "mapper/track/segment_points.h"
#include "mapper/track/tracker.h"

namespace tsdfpp {

// What a frame shows of a model's surface where the model says that it is: of its voxels beside the
// surface, those that lie in the picture on pixels with valid depth.
struct ModelSight {
  int matched = 0;  // depth is there
  int through = 0;  // depth is farther at all pixels around: nothing is there
  int hidden = 0;   // depth is nearer: something is before it
};

// `T_WL` is where the model's lattice is; depth may be off by `margin_m`.
ModelSight LookAtModel(const Frame& frame, const TsdfGrid& model, const Pose& T_WL, double voxel_m,
                       double margin_m);

struct FoundModel {
  Pose T_LC = Pose::Identity();
  double on_surface = 0;  // share of the segment's points
};

// Where a model, whose lattice was last at T_WL_last, is in the camera's frame if a segment is all
// that can be seen of it. Tries places all around the model, registers the best of them
// (sdf_registration.h) and takes the one that the least speaks against: voxels of the model that
// the frame shows through, the points' deviation, and a turn since it was last seen. There the
// points have to be on the surface wherever the model was observed, which half of them must be, and
// hardly a voxel may be seen through. Nothing where no
// place is such, or the segment has too few points. Costs some hundred milliseconds. Deterministic
// for any number of threads.
std::optional<FoundModel> FindModel(const Frame& frame, const std::vector<SegmentPoint>& points,
                                    const TsdfGrid& model, const Pose& T_WL_last, double voxel_m,
                                    const SdfTrackConfig& config);

class LostObjects {
 public:
  // The config must be valid.
  explicit LostObjects(const SdfTrackConfig& config) : config_(config) {}

  // Of the objects with a pose in `T_WO` which the frame does not show (`seen` has none), or not
  // where they could be registered: those that it shows not to be where they were. Of a map with
  // volumes.
  std::vector<InstanceId> NotInPlace(const Frame& frame, const MapRepresentation& map,
                                     const ObjectPoses& T_WO,
                                     const std::map<InstanceId, TrackStatus>& seen) const;

  // Keeps the object's volume, as the map has it.
  void Keep(InstanceId id, const MapRepresentation& map, const Pose& T_WO);

  bool empty() const { return kept_.empty(); }
  bool Has(InstanceId id) const { return kept_.contains(id); }

  struct Found {
    InstanceId id = kNoInstance;
    Pose T_WO = Pose::Identity();
    double on_surface = 0;  // share of the segment's points
  };
  // Where a kept object is, if these pixels are of it. Nothing while they reach the picture's
  // edge, where the rest of them may be, or where FindModel() finds nothing.
  std::optional<Found> Find(InstanceId id, const Frame& frame,
                            const std::vector<int>& pixels) const;
  // Which of the kept objects these pixels are of: the one with the most points on its surface.
  std::optional<Found> FindAny(const Frame& frame, const std::vector<int>& pixels) const;

  // Puts a kept object back into the map and keeps it until Forget(). Errors: MapEditing::Add's.
  Expected<void> PutBack(InstanceId id, const Pose& T_WO, MapRepresentation& map) const;
  void Forget(InstanceId id) { kept_.erase(id); }

  // The last poses of those that are kept.
  ObjectPoses LastPoses() const;

 private:
  struct Kept {
    TsdfGrid volume;
    Pose T_WL = Pose::Identity();
    Pose T_WO = Pose::Identity();
    double voxel_m = 0;
  };

  SdfTrackConfig config_;
  std::map<InstanceId, Kept> kept_;
};

}  // namespace tsdfpp
