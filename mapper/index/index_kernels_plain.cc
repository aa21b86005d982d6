// The lists of the global indices voxel by voxel.
#include <algorithm>

#include "mapper/index/index_kernels.h"

namespace tsdfpp::plain {

VotesCounted VoteForActive(const BlockMask& votes, InstanceId id, int confidence_cap,
                           const InstanceId* active, std::uint8_t* confidences) {
  VotesCounted counted;
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!Bit(votes, i)) continue;
    if (active[i] != id) {
      SetBit(counted.others, i);
      continue;
    }
    if (confidences[i] < confidence_cap) ++confidences[i];
    if (confidences[i] >= confidence_cap) SetBit(counted.saturated, i);
  }
  return counted;
}

void ListAlone(const BlockMask& covered, InstanceId id, InstanceId* ids) {
  for (int i = 0; i < kBlockVoxels; ++i) ids[i] = Bit(covered, i) ? id : kNoInstance;
}

void InsertByDistance(const BlockMask& covered, const float* distance, InstanceId id,
                      const OrderedLists& lists) {
  const auto at = [](int layer, int i) { return layer * kBlockVoxels + i; };
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!Bit(covered, i)) continue;
    int place = 0;
    while (place < lists.layers && !(distance[i] < lists.distance[at(place, i)])) ++place;
    if (place == lists.layers) continue;
    for (int layer = lists.layers - 1; layer > place; --layer) {
      lists.distance[at(layer, i)] = lists.distance[at(layer - 1, i)];
      lists.id[at(layer, i)] = lists.id[at(layer - 1, i)];
    }
    lists.distance[at(place, i)] = distance[i];
    lists.id[at(place, i)] = id;
  }
}

}  // namespace tsdfpp::plain
