// One field with a label a voxel: what `tsdf` and its variants store (docs/map.md, "`tsdf`: one
// field").
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mapper/index/listing.h"
#include "mapper/index/voxel_labels.h"
#include "mapper/index/voxel_list.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

class LabelledField {
 public:
  struct LabelBlock {
    LabelBlock() { id.fill(kNoInstance); }
    std::array<InstanceId, kBlockVoxels> id;
    std::array<std::uint16_t, kBlockVoxels> confidence{};
    std::uint64_t ever = 0;  // bit (id % 64) of every label that the block ever had

    // Notes every label that the block has.
    void NoteLabels();
    void NoteLabel(InstanceId label) { ever |= EverBit(label); }
    bool MayHave(InstanceId label) const { return (ever & EverBit(label)) != 0; }
    bool Has(InstanceId label) const;

   private:
    static std::uint64_t EverBit(InstanceId label) { return 1ULL << (label & 63U); }
  };

  explicit LabelledField(const MapConfig& config) : config_(config) {}

  // The values, and the labels of the same blocks. Whoever changes labels gives the block of values
  // a new revision.
  TsdfGrid& values() { return values_; }
  const TsdfGrid& values() const { return values_; }
  BlockGrid<LabelBlock>& labels() { return labels_; }
  const BlockGrid<LabelBlock>& labels() const { return labels_; }
  void AddBlock(const Index3& index);

  // Whether the object labels a voxel.
  bool Holds(InstanceId id) const;
  // The objects that have voxels which move with them.
  std::vector<InstanceId> Objects() const;
  // Gives the label of the voxel nearest to a point (metres), the background's where it has none.
  VoxelLabels LabelOfVoxels() const;
  std::vector<Listing> ListedAt(const Index3& voxel) const;
  // In no order: those that are labelled; those that are observed and labelled so.
  std::vector<Index3> LabelledVoxels() const;
  std::vector<Index3> ObservedVoxels(InstanceId id) const;

  // The blocks of an object's observed voxels, free space included, with these alone; and their
  // labels.
  struct Part {
    TsdfGrid values;
    BlockGrid<LabelBlock> labels;
  };
  Part PartOf(InstanceId id) const;
  // Makes the object's voxels unlabelled, and unobserved or free; returns their blocks.
  std::vector<Index3> Vacate(InstanceId id, RemovedVoxels become);
  // Writes the values of a block that moved here; where `keep_nearer`, not over those of others
  // that are nearer to a surface. confidence(i) is what voxel i brings along.
  void Arrive(InstanceId id, const Index3& index, const TsdfBlock& arrival, bool keep_nearer,
              const std::function<std::uint16_t(std::size_t)>& confidence);
  // Frees those of these blocks that have no observed voxel.
  void FreeEmpty(const std::vector<Index3>& blocks);
  void Rename(InstanceId from, InstanceId to);

  std::size_t Bytes() const;

  // Labels and confidences of the blocks that have any, in Index3's order.
  std::vector<ListsOfBlock> Lists() const;
  // Loads values and then labels, whose voxels have to be observed. Errors: kData, a fragment.
  void SetValues(TsdfGrid values);
  Expected<void> SetLists(const std::vector<ListsOfBlock>& lists);

  // What docs/map.md rules out, in a sentence.
  std::optional<std::string> FindFault() const;

 private:
  // Whether a voxel that has this distance goes with the object that it is labelled with.
  bool Moves(float distance) const {
    return config_.moved_voxels == MovedVoxels::kAll || distance <= config_.voxel();
  }
  bool IsObjectsVoxel(const TsdfBlock& block, const LabelBlock& labels, std::size_t i,
                      InstanceId id) const {
    return labels.id[i] == id && block.weight[i] > 0 && Moves(block.distance[i]);
  }

  MapConfig config_;
  TsdfGrid values_;
  BlockGrid<LabelBlock> labels_;  // the same blocks
};

}  // namespace tsdfpp
