// The list of one voxel of the tsdf++ index: the active object first, confidences, at most K
// entries (docs/map.md, "The index of tsdf++").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/types.h"

namespace tsdfpp {

inline constexpr int kMaxLayers = 8;

struct ListEntry {
  InstanceId id = kNoInstance;
  std::int16_t confidence = 0;
};

// A view of K stored entries, `stride` apart; the used ones come first.
class VoxelList {
 public:
  VoxelList(ListEntry* entries, int layers, int stride)
      : entries_(entries), layers_(layers), stride_(stride) {
    while (size_ < layers_ && At(size_).id != kNoInstance) ++size_;
  }

  int size() const { return size_; }

  bool Lists(InstanceId id) const {
    for (int i = 0; i < size_; ++i) {
      if (At(i).id == id) return true;
    }
    return false;
  }

  void Remove(InstanceId id) {
    for (int i = 0; i < size_; ++i) {
      if (At(i).id != id) continue;
      for (int k = i; k + 1 < size_; ++k) At(k) = At(k + 1);
      At(--size_) = {};
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
    ListEntry& active = At(0);
    if (active.id == id) {
      if (active.confidence < confidence_cap) ++active.confidence;
      return;
    }
    --active.confidence;
    if (active.confidence <= 0) {
      active.confidence = 0;
      Remove(id);
      PushFront(id, 1);
    } else if (!Lists(id)) {
      Append(id, 1);
    }
  }

 private:
  ListEntry& At(int i) const { return entries_[static_cast<std::ptrdiff_t>(i) * stride_]; }

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
    for (int i = 0; i < count; ++i) At(i) = longer[static_cast<std::size_t>(i)];
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

  ListEntry* entries_;
  int layers_;
  int stride_;
  int size_ = 0;
};

}  // namespace tsdfpp
