// The list of one voxel of the tsdf++ index: the active object first, confidences, at most K
// entries (docs/map.md, "The index of tsdf++").
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/types.h"
#include "mapper/map_config.h"
#include "mapper/volume/block_grid.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// Calls function(place) for each voxel of a mask, in order.
template <typename Function>
void ForEachVoxel(const BlockMask& mask, const Function& function) {
  int first = 0;
  for (std::uint64_t slice : mask) {
    for (; slice != 0; slice &= slice - 1) function(first + std::countr_zero(slice));
    first += 64;
  }
}

struct ListEntry {
  InstanceId id = kNoInstance;
  std::int16_t confidence = 0;
};

// The lists of a block: kBlockVoxels lists of the same number of entries, one after the other.
struct ListsOfBlock {
  Index3 index;
  std::vector<ListEntry> entries;
};

// A view of K stored entries, `stride` apart; the used ones come first. Confidences are at most
// kMostConfidence.
class VoxelList {
 public:
  VoxelList(InstanceId* ids, std::uint8_t* confidences, int layers, int stride)
      : ids_(ids), confidences_(confidences), layers_(layers), stride_(stride) {
    while (size_ < layers_ && IdAt(size_) != kNoInstance) ++size_;
  }

  int size() const { return size_; }

  bool Lists(InstanceId id) const {
    for (int i = 0; i < size_; ++i) {
      if (IdAt(i) == id) return true;
    }
    return false;
  }

  void Remove(InstanceId id) {
    for (int i = 0; i < size_; ++i) {
      if (IdAt(i) != id) continue;
      for (int k = i; k + 1 < size_; ++k) Set(k, At(k + 1));
      Set(--size_, {});
      return;
    }
  }

  // The id must not be listed.
  void PushFront(InstanceId id, int confidence) { Insert(0, id, confidence); }
  void Append(InstanceId id, int confidence) { Insert(size_, id, confidence); }

  // Paper III-F with demotion: one vote for an object that covers the voxel.
  void Vote(InstanceId id, int confidence_cap) {
    if (size_ == 0) {
      PushFront(id, 1);
      return;
    }
    std::uint8_t& confidence = *confidences_;
    if (IdAt(0) == id) {
      if (confidence < confidence_cap) ++confidence;
      return;
    }
    if (confidence > 0) --confidence;
    if (confidence == 0) {
      Remove(id);
      PushFront(id, 1);
    } else if (!Lists(id)) {
      Append(id, 1);
    }
  }

 private:
  std::ptrdiff_t Place(int i) const { return static_cast<std::ptrdiff_t>(i) * stride_; }
  InstanceId IdAt(int i) const { return ids_[Place(i)]; }
  ListEntry At(int i) const { return {IdAt(i), confidences_[Place(i)]}; }
  void Set(int i, const ListEntry& entry) {
    ids_[Place(i)] = entry.id;
    confidences_[Place(i)] = static_cast<std::uint8_t>(entry.confidence);
  }

  void Insert(int at, InstanceId id, int confidence) {
    std::array<ListEntry, kMaxLayers + 1> longer{};
    int count = 0;
    for (int i = 0; i <= size_; ++i) {
      if (i == at)
        longer[static_cast<std::size_t>(count++)] = {id, static_cast<std::int16_t>(confidence)};
      if (i < size_) longer[static_cast<std::size_t>(count++)] = At(i);
    }
    if (count > layers_) {
      const int victim = Victim(longer, count);
      for (int k = victim; k + 1 < count; ++k) {
        longer[static_cast<std::size_t>(k)] = longer[static_cast<std::size_t>(k + 1)];
      }
      --count;
    }
    for (int i = 0; i < count; ++i) Set(i, longer[static_cast<std::size_t>(i)]);
    size_ = count;
  }

  // The inactive entry of least confidence, the one further back among equals; the background only
  // where it is the only one.
  static int Victim(const std::array<ListEntry, kMaxLayers + 1>& list, int count) {
    int victim = -1;
    for (int i = 1; i < count; ++i) {
      const ListEntry& entry = list[static_cast<std::size_t>(i)];
      if (entry.id == kBackground) continue;
      if (victim < 0 || entry.confidence <= list[static_cast<std::size_t>(victim)].confidence) {
        victim = i;
      }
    }
    return victim < 0 ? count - 1 : victim;
  }

  InstanceId* ids_;
  std::uint8_t* confidences_;
  int layers_;
  int stride_;
  int size_ = 0;
};

}  // namespace tsdfpp
