// Lists in the order of distances, against a stable sort.
#include "mapper/index/index_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

// Few different distances, so that most are as near as another: then the object that was put in
// first comes first.
TEST(InsertByDistance, IsAStableSort) {
  constexpr int kObjects = 6;
  constexpr int kLayers = 4;
  Dice dice(3);
  std::array<std::array<float, kBlockVoxels>, kObjects> distance{};
  std::array<BlockMask, kObjects> covered{};
  for (std::size_t o = 0; o < kObjects; ++o) {
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      distance[o][i] = 0.01F * static_cast<float>(dice.Whole(3) - 1);
      if (dice.Whole(4) > 0) covered[o][i / 64] |= std::uint64_t{1} << (i % 64);
    }
  }
  std::vector<float> listed(kLayers * kBlockVoxels, std::numeric_limits<float>::infinity());
  std::vector<InstanceId> ids(kLayers * kBlockVoxels, kNoInstance);
  for (std::size_t o = 0; o < kObjects; ++o) {
    InsertByDistance(covered[o], distance[o].data(), static_cast<InstanceId>(o),
                     {kLayers, listed.data(), ids.data()});
  }
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    std::vector<std::size_t> expected;
    for (std::size_t o = 0; o < kObjects; ++o) {
      if ((covered[o][i / 64] >> (i % 64) & 1U) != 0) expected.push_back(o);
    }
    std::stable_sort(expected.begin(), expected.end(),
                     [&](std::size_t a, std::size_t b) { return distance[a][i] < distance[b][i]; });
    for (std::size_t k = 0; k < kLayers; ++k) {
      const InstanceId id =
          k < expected.size() ? static_cast<InstanceId>(expected[k]) : kNoInstance;
      ASSERT_EQ(ids[k * kBlockVoxels + i], id) << "voxel " << i << ", layer " << k;
    }
  }
}

}  // namespace
}  // namespace tsdfpp
