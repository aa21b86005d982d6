// The global map volume of `tsdf++/literal`: an active and an inactive object at each voxel, each
// with its confidence, changed by the paper's sentences (III-A, III-E, III-F; docs/map.md,
// "`tsdf++/literal`: the paper's sentences").
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "mapper/index/listing.h"
#include "mapper/index/voxel_list.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

class PairIndex {
 public:
  struct Entry {
    InstanceId id = kNoInstance;
    std::int16_t confidence = 0;
  };
  struct Block {
    std::array<Entry, kBlockVoxels> active{};
    std::array<Entry, kBlockVoxels> inactive{};
    std::uint64_t revision = 0;  // a new one whenever an active id changes
    bool IsEmpty() const;
  };
  using Grid = BlockGrid<Block>;

  explicit PairIndex(const MapConfig& config) : config_(config) {}

  // For fusion, which makes blocks and votes in several of them at once.
  Grid& blocks() { return blocks_; }
  const Grid& blocks() const { return blocks_; }

  // Paper III-F: a vote for the observed object at a voxel.
  void Vote(Block& block, std::size_t voxel, InstanceId observed) const {
    Entry& active = block.active[voxel];
    const InstanceId before = active.id;
    if (active.id == observed) {
      if (active.confidence < config_.confidence_cap) ++active.confidence;
    } else if (active.id == kNoInstance || --active.confidence <= 0) {
      active = {observed, 1};
      if (block.inactive[voxel].id == observed) block.inactive[voxel] = {};
    }
    if (active.id != before) block.revision = NewRevision();
  }

  // Paper III-E: takes the object off all voxels; where it was active the inactive one is
  // activated. Returns the blocks in which it was active, for FreeEmpty().
  std::vector<Index3> Deactivate(InstanceId id);
  // Makes the object active wherever its volume, whose lattice is the world's, is observed; who was
  // is inactive then.
  void Activate(InstanceId id, const TsdfGrid& volume);
  // Frees those of these blocks that list nobody.
  void FreeEmpty(const std::vector<Index3>& blocks);

  void Rename(InstanceId from, InstanceId to);

  std::vector<Listing> ListedAt(const Index3& voxel) const;
  // In no order.
  std::vector<Index3> ListedVoxels() const;
  std::size_t Bytes() const { return blocks_.size() * sizeof(Block) + blocks_.TableBytes(); }

  // Both entries of each voxel, by block in Index3's order; and an empty index filled with them.
  std::vector<ListsOfBlock> Lists() const;
  void SetLists(const std::vector<ListsOfBlock>& lists);

  // What docs/map.md rules out, in a sentence.
  std::optional<std::string> FindFault(const ObjectVolumes& volumes) const;

 private:
  MapConfig config_;
  Grid blocks_;
};

}  // namespace tsdfpp
