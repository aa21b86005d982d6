// The global map volume of `tsdf++`: a list of objects with confidences at each voxel, changed by
// the paper's verbs (III-E, III-F; docs/map.md, "The index of tsdf++").
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mapper/index/cover.h"
#include "mapper/index/global_index.h"
#include "mapper/index/voxel_list.h"

namespace tsdfpp {

// The volumes are the objects', in the world's lattice, their covers as of the last event.
class VotingIndex final : public GlobalIndex {
 public:
  // Up to `layers` objects a voxel.
  VotingIndex(const MapConfig& config, int layers) : config_(config), layers_(layers) {}

  const InstanceId* ActiveIn(const Index3& block) const override;
  std::vector<Listing> ListedAt(const Index3& voxel) const override;
  const ChangeLog& changes() const override { return changes_; }
  // In no order.
  std::vector<Index3> ListedVoxels() const;

  // Paper III-E: takes the object off every list; the next one becomes active. Returns the blocks
  // of the index that lost a listing, for FreeEmptyLists().
  std::vector<Index3> Deactivate(InstanceId id, const TsdfGrid& volume);
  // Puts the object first where it covers a voxel now; brings the volume's covers up to date.
  void Activate(InstanceId id, const TsdfGrid& volume);
  // Frees those of these blocks whose lists are all empty, and the last layers of the others where
  // they are.
  void FreeEmptyLists(const std::vector<Index3>& blocks);

  // Paper III-F: what a frame's fusion changes, by the votes of what was fused and by what the
  // objects cover now.
  void Update(const std::vector<FusedBlock>& fused, const std::vector<CoverChange>& changes);

  // Takes an object off every list that is none of the `others` any more.
  void Remove(InstanceId id, const TsdfGrid& volume, const ObjectVolumes& others);
  void Rename(InstanceId from, InstanceId to, const TsdfGrid& volume);

  std::size_t blocks() const { return blocks_.size(); }
  std::size_t Bytes() const;

  // All lists, K entries a voxel, by block in Index3's order; and an index without lists made from
  // them.
  std::vector<ListsOfBlock> Lists() const;
  void SetLists(const std::vector<ListsOfBlock>& lists);

  // What docs/map.md rules out of the lists by themselves, in a sentence.
  std::optional<std::string> FindFault() const;

 private:
  struct ListBlock {
    // Entry k of the list of voxel i at [k * kBlockVoxels + i]; as many layers as its longest list.
    std::vector<InstanceId> ids;
    std::vector<std::uint8_t> confidences;
    // Voxels where `settled_id` is active with full confidence, so that its votes change nothing.
    BlockMask settled{};
    InstanceId settled_id = kNoInstance;

    std::size_t layers() const { return ids.size() / kBlockVoxels; }
    // Takes no more room than that; new entries are empty.
    void Resize(std::size_t layers);
    ListEntry At(std::size_t i) const { return {ids[i], confidences[i]}; }
    InstanceId ActiveAt(int place) const { return ids[static_cast<std::size_t>(place)]; }
  };
  class Groups;

  ListBlock& ListsOf(const Index3& block);
  // To be changed: the voxel is no longer taken for settled.
  static VoxelList ListOf(ListBlock& lists, int place) {
    lists.settled[static_cast<std::size_t>(place >> 6)] &=
        ~(1ULL << static_cast<unsigned>(place & 63));
    const auto at = static_cast<std::size_t>(place);
    return {&lists.ids[at], &lists.confidences[at], static_cast<int>(lists.layers()), kBlockVoxels};
  }
  // The same with room for one object more, unless it has K.
  VoxelList ListWithRoom(ListBlock& lists, int place) const {
    const std::size_t layers = lists.layers();
    const std::size_t last = (layers - 1) * kBlockVoxels + static_cast<std::size_t>(place);
    if (lists.ids[last] != kNoInstance && layers < static_cast<std::size_t>(layers_)) {
      lists.Resize(layers + 1);
    }
    return ListOf(lists, place);
  }
  // True where another object is active than was.
  bool Vote(ListBlock& lists, InstanceId id, BlockMask votes) const;
  static void FreeEmptyLayers(ListBlock& lists);
  static bool IsEmpty(const ListBlock& lists);

  MapConfig config_;
  int layers_;
  BlockGrid<ListBlock> blocks_;
  ChangeLog changes_;
};

}  // namespace tsdfpp
