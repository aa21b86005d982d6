// The field of the active objects' values, from which the visible scene of `tsdf++/literal` is
// meshed and cast: a function of pairs and volumes, made when it is read.
#pragma once

#include <vector>

#include "mapper/index/pair_index.h"
#include "mapper/index/refresh_once.h"
#include "mapper/index/voxel_labels.h"

namespace tsdfpp {

// A copy starts empty.
class ActiveField {
 public:
  ActiveField() = default;
  ActiveField(const ActiveField&) {}
  ActiveField& operator=(const ActiveField&) = delete;
  ~ActiveField() = default;

  // Told by whoever changes pairs and values, while nobody reads: which blocks changed, of the
  // `all` that the index has; that any may have.
  void Note(const std::vector<Index3>& changed, std::size_t all);
  void NoteAll();

  // The field as pairs and volumes are now. Any number of threads at once; `config` is the map's.
  const TsdfGrid& Of(const PairIndex& pairs, const ObjectVolumes& volumes,
                     const MapConfig& config) const;

  // Of the field's blocks and what is known of them.
  std::size_t Bytes() const;

 private:
  void MakeAgain(const PairIndex& pairs, const ObjectVolumes& volumes, float back) const;

  RefreshOnce once_;
  // Blocks of lists or values that may have changed since it was made.
  mutable bool all_are_stale_ = true;
  mutable std::vector<Index3> stale_;
  mutable TsdfGrid field_;
  // Revisions of the lists and of each volume.
  mutable BlockGrid<std::vector<std::uint64_t>> made_from_;
};

// Gives the active object of the voxel nearest to a point (metres), the background where there is
// none.
VoxelLabels ActiveLabels(const PairIndex& pairs);

}  // namespace tsdfpp
