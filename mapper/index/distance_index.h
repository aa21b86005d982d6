// The global map volume of `tsdf++/anchored`: at each voxel the objects that cover it, by distance;
// a function of volumes and poses (docs/map.md, "The index of tsdf++/anchored").
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mapper/index/cover.h"
#include "mapper/index/global_index.h"
#include "mapper/index/refresh_once.h"

namespace tsdfpp {

// Kept from event to event; what an event made out of date is made again by Refresh(), which
// whoever reads calls first. The volumes are the objects', each in its own lattice; it keeps the
// covers of those whose lattice is the world's.
class DistanceIndex final : public GlobalIndex {
 public:
  // Up to `layers` objects a voxel.
  DistanceIndex(const MapConfig& config, int layers) : config_(config), layers_(layers) {}

  // What follows is told by whoever changes volumes and poses, while nobody reads.

  // Before an object is moved, changed or taken out: where it is listed the lists are to be made
  // again. Does nothing where there is no such volume.
  void Deactivate(InstanceId id, const ObjectVolumes& volumes);
  // After it was moved, changed or put in: likewise where it may be listed now.
  void Activate(InstanceId id);
  // After a frame was fused into the volumes and before its empty blocks are freed.
  void NoteFusion(const std::vector<FusedBlock>& fused, const ObjectVolumes& volumes);
  // Forgets everything.
  void Reset(const ObjectVolumes& volumes);

  // Brings the index in line with the volumes. Cheap where it is; by any number of threads at once.
  void Refresh(const ObjectVolumes& volumes) const {
    once_.Run([&] { MakeAgain(volumes); });
  }

  // Of the index as it was last refreshed.
  const InstanceId* ActiveIn(const Index3& block) const override;
  std::vector<Listing> ListedAt(const Index3& voxel) const override;
  const ChangeLog& changes() const override { return changes_; }
  // In no order.
  std::vector<Index3> ListedVoxels() const;
  std::size_t blocks() const;
  std::size_t Bytes() const;

  // Where it is not what one made from the volumes alone is, in a sentence.
  std::optional<std::string> FindFault(const ObjectVolumes& volumes) const;

 private:
  // Entry k of the list of voxel i at [k * kBlockVoxels + i], active first, kNoInstance where
  // unused; as many layers as the block has objects, up to K.
  using IndexBlock = std::vector<InstanceId>;
  struct Participants;
  struct Scratch;

  void MakeAgain(const ObjectVolumes& volumes) const;
  Participants ParticipantsOf(const ObjectVolumes& volumes) const;
  void AddReach(InstanceId id, const ObjectVolumes& volumes) const;
  void ComputeBlock(const Index3& index, const Participants& participants, Scratch& scratch,
                    IndexBlock& ids) const;

  MapConfig config_;
  int layers_;
  RefreshOnce once_;
  // All that follows is a function of volumes and poses, or says where it is not up to date.
  mutable BlockGrid<IndexBlock> blocks_;
  // Global blocks that an object whose lattice is not the world's can list.
  mutable std::map<InstanceId, std::vector<Index3>> reach_;
  mutable std::vector<Index3> dirty_;
  mutable std::vector<InstanceId> moved_;  // objects whose whole reach is dirty
  mutable ChangeLog changes_;
};

}  // namespace tsdfpp
