// The pipeline's tracker `track`: registers each object's segment to its signed distances, from
// where its last motion would bring it, and freezes what it cannot register (docs/tracking.md).
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "mapper/track/calibration.h"
#include "mapper/track/object_model.h"
#include "mapper/track/sdf_registration.h"
#include "mapper/track/tracker.h"
#include "mapper/track/view_terms.h"

namespace tsdfpp {

// Where a tracker gets an object's model from, as ModelOf() does. Called by several threads at a
// time.
using ModelSource = std::function<std::optional<ObjectModel>(const MapRepresentation&, InstanceId)>;

class SdfTracker : public Tracker {
 public:
  // The config must be valid. Models are the map's, unless others are known. Where `waits` for
  // motion, an object stays where it began until it is known to have moved (TrackedPoses::moved);
  // in frames that say that it is elsewhere, before, it is frozen.
  explicit SdfTracker(const SdfTrackConfig& config, ModelSource models = ModelOf,
                      bool waits = false)
      : config_(config), models_(std::move(models)), waits_(waits) {}

  // An object's frame O is its lattice: its pose is the identity where it is first seen with enough
  // points. Frozen are objects that have too few points, are not registered, or fail a gate: they
  // stay where they were.
  TrackedPoses Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                     const ObjectPoses& before) override;

  void Place(InstanceId id, int frame, PlacedModel model) override;

 private:
  // A segment whose place on the object is known: how far off it is when it is registered to the
  // model as it is now says how far off the model makes others.
  struct Keyframe {
    std::vector<SegmentPoint> points;
    Pose T_OC = Pose::Identity();
    Intrinsics camera;
    KeyView view;
  };

  // What is remembered of an object beside its pose.
  struct Memory {
    int frame = 0;                            // the last at which it was tracked
    bool was_at_rest = true;                  // in every frame so far
    Pose motion_L = Pose::Identity();         // a frame: T_WL(before)^-1 * T_WL(after)
    std::optional<Eigen::Vector3d> centre_O;  // of its segment then
    std::optional<Keyframe> keyframe;
    std::optional<Keyframe> anchor;         // another, kept for longer
    std::optional<Keyframe> waiting;        // to be both, while it is at rest
    std::int64_t waiting_since = 0;         // frame
    std::optional<PlaceUncertainty> place;  // then
    std::optional<Vector6> leaning;         // of what was left at rest: to where it was found
    std::deque<Pose> T_WO_last;             // of the last rest_frames in a row, oldest first
    // Of one that waits for motion.
    std::optional<Pose> T_WO_begun;  // where it was when it was registered first
    bool has_moved = false;
    bool is_placed = false;    // by Place(), since it was registered last
    int turn_before = 0;       // the last in which it was registered, here or elsewhere
    int turns_away = 0;        // of those, in a row, from where it began
    double evidence_away = 0;  // in all of these turns, of each over FewPointsFactor()
    int turns_waited = 0;      // of those, in a row, for more of a motion
  };

  // A frame's segment of an object, and the object as the map has it.
  struct Sight {
    const Frame* frame = nullptr;
    const cv::Mat* labels = nullptr;
    InstanceId id = kNoInstance;
    const std::vector<SegmentPoint>* points = nullptr;
    Eigen::Vector3d centre_C = Eigen::Vector3d::Zero();  // of the points
    std::function<const SegmentView&()> view{};          // made where it is asked for
    const TsdfGrid* grid = nullptr;
    const SurfaceReader* model = nullptr;  // of the grid
    double voxel_m = 0;
    Pose T_WL = Pose::Identity();
    Pose T_LO = Pose::Identity();
    int passed = 1;  // frames since it was last tracked

    // Where the camera is in L if the object stayed where it was.
    Pose T_LC_stay() const;
    // The motion since the frame before, T_WL(before)^-1 * T_WL(after), where the camera is there.
    Pose MotionTo(const Pose& T_LC) const;
  };

  struct Registered {
    Pose T_WL = Pose::Identity();  // after the frame
    MotionUncertainty motion;
  };

  // One object of a frame, and what became of it.
  struct Turn {
    InstanceId id = kNoInstance;
    std::vector<int> pixels;  // of its segment, without the outline
    Memory* memory = nullptr;
    TrackStatus status = TrackStatus::kFrozen;
    std::optional<MotionUncertainty> motion{};
    std::optional<Pose> moved_to{};  // its pose T_WO; nothing where it stays where it was
    bool has_moved = false;          // it is known to have
  };

  // May run beside the turns of other objects.
  void Take(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
            const ObjectPoses& before, Turn& turn) const;
  // Nothing where the object is frozen. T_WO is that before the frame; `sight` has the frame and
  // what it shows of the object.
  std::optional<Registered> Register(Sight sight, const ObjectModel& model, const Pose& T_WO,
                                     Memory& memory) const;
  SdfRegistration TaskOf(const Sight& sight, const Memory& memory) const;
  // What a frame says of an object that was at rest.
  struct Rest {
    bool is_kept = false;  // nothing says that it is at rest no more
    bool is_back = false;  // or it rests again, where it was some frames ago
    double evidence = 0;   // against its place; 0 where it was not at rest
    // That place, and the points there; of an object that was at rest.
    Pose T_LC = Pose::Identity();
    DistanceCounts counts;
  };
  // `found` is then that place. The points are at their nearest to the model at `nearest`, of which
  // `found` is the best guess.
  Rest StayAtRest(const Sight& sight, const SdfRegistration& task,
                  const SdfRegistrationResult& nearest, Memory& memory,
                  SdfRegistrationResult& found) const;
  // Whether its last places and the one found go one way (SdfTrackConfig::rest_trend).
  bool GoesOneWay(const Sight& sight, const SdfRegistrationResult& found,
                  const Memory& memory) const;
  // What moved, and may rest again. `found` is then where it was rest_frames frames ago.
  bool RestsAgain(const Sight& sight, const SdfRegistration& task,
                  const SdfRegistrationResult& nearest, const Memory& memory,
                  SdfRegistrationResult& found) const;
  // Takes in how far it is from where it began. Whether it is to wait for more of its motion; it
  // does not wait for ever, and then `found` is where it is at rest.
  bool Waits(const Sight& sight, const Rest& rest, Memory& memory,
             SdfRegistrationResult& found) const;
  // What the terms beside the distances are made of, but the view; `bias` is SdfRegistration's.
  ViewTermParts PartsOf(const Sight& sight, const Memory& memory, const Pose& bias) const;
  // What a keyframe says that the model adds to places.
  std::optional<Calibration> Calibrate(const Sight& sight,
                                       const std::optional<Keyframe>& keyframe) const;
  bool PassesGates(const Sight& sight, const SdfRegistrationResult& found) const;
  // Much of it is hidden, and what is left says little about its place.
  bool IsHardlySeen(const Sight& sight, const SdfRegistrationResult& found) const;
  // How well its motion is known since it was last tracked; remembers the place for the next.
  MotionUncertainty Uncertainty(const Sight& sight, const SdfRegistrationResult& found,
                                Memory& memory) const;
  void Remember(const Sight& sight, const SdfRegistrationResult& found, const Rest& rest,
                Memory& memory) const;
  // Where there is none, or the object has turned so far since; `turn_rad` 0: keeps none.
  void Renew(std::optional<Keyframe>& keyframe, double turn_rad, const Sight& sight,
             const Pose& T_OC) const;
  // Of what was at rest so far: both, seen from another side (SdfTrackConfig::rest_turn_rad).
  void RenewAtRest(const Sight& sight, const Pose& T_OC, Memory& memory) const;
  // The segment, seen from there.
  Keyframe KeyframeOf(const Sight& sight, const Pose& T_OC) const;

  SdfTrackConfig config_;
  ModelSource models_;
  bool waits_;
  int turn_ = 0;  // calls of Track()
  std::map<InstanceId, Memory> memory_;
};

}  // namespace tsdfpp
