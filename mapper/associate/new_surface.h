// Surface that no map knows yet, until frames have agreed whose it is.
#pragma once

#include <map>
#include <span>
#include <vector>

#include "core/types.h"
#include "mapper/associate/object_cells.h"
#include "mapper/associate/object_lookup.h"

namespace tsdfpp {

// What of an object is apart from the rest of it is confirmed in so many times more frames: where a
// mask is off its object, what it takes lies far away.
inline constexpr int kTimesLongerApart = 10;

// A point of a frame on no known surface.
struct NewPoint {
  InstanceId label = kBackground;
  Eigen::Vector3d p_W = Eigen::Vector3d::Zero();
};

class NewSurface {
 public:
  // A label is confirmed in a cell where it was seen in `confirm_frames` frames, none of them more
  // than `forget_frames` after the one before. An object without surface was seen in enough frames
  // after `birth_frames`.
  NewSurface(int confirm_frames, int birth_frames, int forget_frames)
      : confirm_frames_(confirm_frames),
        birth_frames_(birth_frames),
        forget_frames_(forget_frames) {}

  // Takes in the points of the next frame. Says for each whether its label is confirmed in its
  // cell. The cells of an object, of which `lookup` has all with a surface, are those of its own
  // frame; such as are apart from it need kTimesLongerApart times as many frames: with no surface
  // in a voxel block beside the point's or, of an object without any surface, outside of the
  // greatest part of its confirmed cells (cubes of four, connected through neighbours). Where an
  // object without surface was seen in enough frames, but most of its cells were not, it moves and
  // nobody knows how, as no tracker can before it is in the map: it begins with the greatest part
  // of what this frame shows. The background has no such parts.
  std::vector<bool> Confirm(std::span<const NewPoint> points, const ObjectCells& cells,
                            const ObjectLookup& lookup);

 private:
  // Of a label in a cell.
  struct Sightings {
    Index3 cell;
    int frames = 0;
    int last = 0;  // frame
  };
  using Counted = std::vector<Sightings>;  // sorted by cell

  class Body;

  // Counts the frame's cells of one label, sorted.
  void Count(const std::vector<Index3>& seen, Counted& counted) const;
  static int FramesOf(const Counted& counted, const Index3& cell);

  int confirm_frames_;
  int birth_frames_;
  int forget_frames_;
  int frame_ = 0;                          // counted here
  std::map<InstanceId, Counted> counted_;  // by label
  // Of labels that the map had no surface of; their cells mean nothing.
  std::map<InstanceId, Sightings> labelled_;
};

}  // namespace tsdfpp
