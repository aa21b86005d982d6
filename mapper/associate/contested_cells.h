// Places of objects' surfaces that masks dispute: what was fused under a wrong label is found by
// the frames in which its place has another one.
#pragma once

#include <map>
#include <vector>

#include "core/types.h"
#include "mapper/volume/block_grid.h"

namespace tsdfpp {

// What a frame's mask says of a point on an object's surface.
struct Testimony {
  InstanceId object = kBackground;
  Index3 cell;             // of the object's frame
  bool is_own = false;     // the mask gives the point to the object
  float observations = 0;  // of the surface there, before the frame
};

// By object and cell.
bool IsOfLowerCell(const Testimony& a, const Testimony& b);

class ContestedCells {
 public:
  // In how many of the frames that disputed a cell it was its object's, 0 to 1; 1 where none did.
  double ShareOf(InstanceId object, const Index3& cell) const;
  // Whether a frame has disputed a cell, or any of the object.
  bool IsContested(InstanceId object, const Index3& cell) const;
  bool HasAny(InstanceId object) const { return cells_.contains(object); }

  // Takes in what is said in the next frame. A cell is its object's in it if an eighth of what is
  // said of the cell is: where an object stands on another, both are seen in one cell. It is
  // disputed from the first frame on in which it is not; the observations until then are frames in
  // which it was its object's.
  void Add(std::vector<Testimony> said);

  // The cells that were another's in more frames than their object's, by object but for the
  // background, in order. They are contested no longer.
  std::map<InstanceId, std::vector<Index3>> TakeLost();

 private:
  struct Cell {
    Index3 cell;
    float own = 0;    // frames
    float other = 0;  // frames
  };
  using Cells = std::vector<Cell>;  // sorted

  static Cells::const_iterator PlaceIn(const Cells& cells, const Index3& cell);
  const Cell* Find(InstanceId object, const Index3& cell) const;

  std::map<InstanceId, Cells> cells_;
};

}  // namespace tsdfpp
