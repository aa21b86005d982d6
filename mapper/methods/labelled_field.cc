#include "mapper/methods/labelled_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include "mapper/index/grid_invariants.h"

namespace tsdfpp {
namespace {

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

void LabelledField::LabelBlock::NoteLabels() {
  for (const InstanceId label : id) {
    if (label != kNoInstance) NoteLabel(label);
  }
}

bool LabelledField::LabelBlock::Has(InstanceId label) const {
  return MayHave(label) && std::find(id.begin(), id.end(), label) != id.end();
}

void LabelledField::AddBlock(const Index3& index) {
  values_.FindOrAdd(index);
  labels_.FindOrAdd(index);
}

bool LabelledField::Holds(InstanceId id) const {
  return std::any_of(labels_.entries().begin(), labels_.entries().end(),
                     [&](const auto& entry) { return entry.block->Has(id); });
}

std::vector<InstanceId> LabelledField::Objects() const {
  std::set<InstanceId> ids;
  for (const auto& entry : labels_.entries()) {
    const TsdfBlock& block = *values_.Find(entry.index);
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      const InstanceId id = entry.block->id[i];
      if (id != kNoInstance && IsObjectsVoxel(block, *entry.block, i, id)) ids.insert(id);
    }
  }
  return {ids.begin(), ids.end()};
}

VoxelLabels LabelledField::LabelOfVoxels() const {
  return LabelsOf(labels_,
                  [](const LabelBlock& block, std::size_t place) { return block.id[place]; });
}

std::vector<Listing> LabelledField::ListedAt(const Index3& voxel) const {
  const LabelBlock* labels = labels_.Find(BlockOf(voxel));
  const std::size_t i = At(PlaceInBlock(voxel));
  if (labels == nullptr || labels->id[i] == kNoInstance) return {};
  return {{labels->id[i], labels->confidence[i]}};
}

std::vector<Index3> LabelledField::LabelledVoxels() const {
  std::vector<Index3> voxels;
  for (const auto& entry : labels_.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (entry.block->id[At(place)] != kNoInstance) voxels.push_back(VoxelAt(entry.index, place));
    }
  }
  return voxels;
}

std::vector<Index3> LabelledField::ObservedVoxels(InstanceId id) const {
  std::vector<Index3> voxels;
  for (const auto& entry : labels_.entries()) {
    const TsdfBlock& block = *values_.Find(entry.index);
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (entry.block->id[At(place)] == id && block.weight[At(place)] > 0) {
        voxels.push_back(VoxelAt(entry.index, place));
      }
    }
  }
  return voxels;
}

LabelledField::Part LabelledField::PartOf(InstanceId id) const {
  Part part;
  for (const auto* entry : labels_.Sorted()) {
    if (!entry->block->MayHave(id)) continue;
    auto block = std::make_unique<TsdfBlock>(*values_.Find(entry->index));
    bool any = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (entry->block->id[i] != id) block->weight[i] = 0;
      any = any || block->weight[i] > 0;
    }
    if (!any) continue;
    block->UpdateMasks(config_.back());
    part.values.Add(entry->index, std::move(block));
    part.labels.FindOrAdd(entry->index) = *entry->block;
  }
  return part;
}

std::vector<Index3> LabelledField::Vacate(InstanceId id, RemovedVoxels become) {
  std::vector<Index3> blocks;
  for (const auto& entry : labels_.entries()) {
    LabelBlock& labels = *entry.block;
    if (!labels.MayHave(id)) continue;
    TsdfBlock& block = *values_.Find(entry.index);
    bool changed = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (!IsObjectsVoxel(block, labels, i, id)) continue;
      block.Clear(static_cast<int>(i));
      if (become == RemovedVoxels::kFree) {
        block.distance[i] = config_.front();
        block.weight[i] = 1;
      }
      labels.id[i] = kNoInstance;
      labels.confidence[i] = 0;
      changed = true;
    }
    if (!changed) continue;
    block.UpdateMasks(config_.back());
    blocks.push_back(entry.index);
  }
  return blocks;
}

void LabelledField::Arrive(InstanceId id, const Index3& index, const TsdfBlock& arrival,
                           bool keep_nearer,
                           const std::function<std::uint16_t(std::size_t)>& confidence) {
  TsdfBlock* block = nullptr;
  LabelBlock* labels = nullptr;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    if (arrival.weight[i] <= 0 || !Moves(arrival.distance[i])) continue;
    if (block == nullptr) {
      block = &values_.FindOrAdd(index);
      labels = &labels_.FindOrAdd(index);
    }
    if (keep_nearer && block->weight[i] > 0 && labels->id[i] != id &&
        std::abs(block->distance[i]) <= std::abs(arrival.distance[i])) {
      continue;
    }
    block->distance[i] = arrival.distance[i];
    block->weight[i] = arrival.weight[i];
    block->SetColour(i, arrival.FixedColourAt(i), arrival.ColourCount(i));
    labels->id[i] = id;
    labels->confidence[i] = confidence(i);
    labels->NoteLabel(id);
  }
  if (block != nullptr) block->UpdateMasks(config_.back());
}

void LabelledField::FreeEmpty(const std::vector<Index3>& blocks) {
  std::vector<Index3> empty;
  for (const Index3& index : blocks) {
    if (!values_.Find(index)->AnyObserved()) empty.push_back(index);
  }
  values_.Erase(empty);
  labels_.Erase(empty);
}

void LabelledField::Rename(InstanceId from, InstanceId to) {
  for (const auto& entry : labels_.entries()) {
    if (!entry.block->Has(from)) continue;
    entry.block->NoteLabel(to);
    std::replace(entry.block->id.begin(), entry.block->id.end(), from, to);
    values_.Find(entry.index)->revision = NewRevision();
  }
}

std::size_t LabelledField::Bytes() const {
  return tsdfpp::BytesOf(values_) + values_.size() * sizeof(LabelBlock) + labels_.TableBytes();
}

std::vector<ListsOfBlock> LabelledField::Lists() const {
  std::vector<ListsOfBlock> lists;
  for (const auto* entry : labels_.Sorted()) {
    ListsOfBlock block{entry->index, {}};
    bool any = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      block.entries.push_back(
          {entry->block->id[i], static_cast<std::int16_t>(entry->block->confidence[i])});
      any = any || entry->block->id[i] != kNoInstance;
    }
    if (any) lists.push_back(std::move(block));
  }
  return lists;
}

void LabelledField::SetValues(TsdfGrid values) {
  values_ = std::move(values);
  for (const auto& entry : values_.entries()) labels_.FindOrAdd(entry.index);
}

Expected<void> LabelledField::SetLists(const std::vector<ListsOfBlock>& lists) {
  for (const ListsOfBlock& block : lists) {
    LabelBlock& labels = *labels_.Find(block.index);
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      labels.id[i] = block.entries[i].id;
      labels.confidence[i] = static_cast<std::uint16_t>(block.entries[i].confidence);
      if (labels.id[i] == kNoInstance) continue;
      if (labels.confidence[i] == 0) return DataError("a label has no confidence");
      labels.NoteLabel(labels.id[i]);
    }
  }
  return {};
}

Fault LabelledField::FindFault() const {
  if (Fault fault = FindGridFault("the field", values_, config_, false)) return fault;
  if (Fault fault = FindHashFault("the labels", labels_)) return fault;
  for (const auto& [index, labels] : labels_.entries()) {
    const TsdfBlock* block = values_.Find(index);
    if (block == nullptr) return fmt::format("block {} of labels has no field", BlockText(index));
    for (int place = 0; place < kBlockVoxels; ++place) {
      const std::size_t i = At(place);
      const bool labelled = labels->id[i] != kNoInstance;
      const bool remembered = !labelled || labels->MayHave(labels->id[i]);
      if (labelled != (labels->confidence[i] > 0) || (labelled && block->weight[i] <= 0) ||
          !remembered) {
        return fmt::format("the label of voxel {} is wrong", BlockText(VoxelAt(index, place)));
      }
    }
  }
  return std::nullopt;
}

}  // namespace tsdfpp
