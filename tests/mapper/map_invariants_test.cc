// What the check of the invariants notices: a map is tampered with, one number at a time.
#include "mapper/methods/map_invariants.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "mapper/index/cover.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/every_method.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

class Invariants : public EveryMethodTest {
 protected:
  // A block of the brick with a voxel that is observed, and one that is not.
  struct Place {
    TsdfBlock* block = nullptr;
    std::size_t observed = 0;
    std::size_t unobserved = 0;
  };
  static Place FindPlace(const MapRepresentation& map) {
    for (const auto& entry : VoxelsOf(map).GridOf(kBrick)->entries()) {
      Place place{entry.block.get(), kBlockVoxels, kBlockVoxels};
      for (std::size_t i = 0; i < kBlockVoxels; ++i) {
        (entry.block->weight[i] > 0 ? place.observed : place.unobserved) = i;
      }
      if (place.observed < kBlockVoxels && place.unobserved < kBlockVoxels) return place;
    }
    return {};
  }

  void ExpectFault(const std::string& words, const std::function<void(Place&)>& tamper) {
    const auto map = DrivenMap(GetParam(), ToyConfig(), 2);
    ASSERT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
    Place place = FindPlace(*map);
    ASSERT_NE(place.block, nullptr);
    tamper(place);
    const auto fault = VoxelsOf(*map).FindFault();
    ASSERT_TRUE(fault.has_value()) << words;
    EXPECT_NE(fault->find(words), std::string::npos) << *fault;
  }
};
TSDFPP_FOR_EVERY_VOXEL_METHOD(Invariants);

std::vector<Method> MethodsWithLists() {
  std::vector<Method> methods = VoxelMethods();
  std::erase_if(methods, [](Method method) { return !KeepsLists(method); });
  return methods;
}

class ListInvariants : public EveryMethodTest {};
INSTANTIATE_TEST_SUITE_P(Methods, ListInvariants, ::testing::ValuesIn(MethodsWithLists()),
                         [](const auto& tested) { return MethodTestName(tested.param); });

TEST_P(Invariants, ValuesOutOfRangeAreNoticed) {
  ExpectFault("has distance", [](Place& p) { p.block->distance[p.observed] = 1; });
  ExpectFault("has distance", [](Place& p) {
    p.block->distance[p.observed] = std::numeric_limits<float>::quiet_NaN();
  });
  ExpectFault("has weight", [](Place& p) { p.block->weight[p.observed] = 51; });
  ExpectFault("has weight", [](Place& p) { p.block->weight[p.observed] = 255; });
  ExpectFault("colours", [](Place& p) { p.block->SetColour(p.observed, {}, 200); });
  ExpectFault("is unobserved and holds", [](Place& p) { p.block->distance[p.unobserved] = 0.01F; });
  ExpectFault("is unobserved and holds", [](Place& p) {
    ColourSlice& colours = p.block->MakeColours(p.unobserved / kSliceVoxels);
    colours.channel[1][p.unobserved % kSliceVoxels] = 1;
  });
  ExpectFault("no voxel with a colour", [](Place& p) {
    const std::size_t z = p.observed / kSliceVoxels;
    p.block->colours[z].reset();
    p.block->MakeColours(z);
  });
}

TEST_P(Invariants, MasksThatAreNotOfTheValuesAreNoticed) {
  for (BlockMask TsdfBlock::*mask :
       {&TsdfBlock::observed, &TsdfBlock::negative, &TsdfBlock::band, &TsdfBlock::full}) {
    ExpectFault("the masks of voxel",
                [mask](Place& p) { (p.block->*mask)[p.observed / 64] ^= 1ULL << p.observed % 64; });
  }
  if (GetParam() == Method::kTsdfpp) {
    ExpectFault("the cover of voxel",
                [](Place& p) { p.block->cover[p.observed / 64] ^= 1ULL << p.observed % 64; });
    ExpectFault("whether the cube of voxel",
                [](Place& p) { p.block->crossed[p.observed / 64] ^= 1ULL << p.observed % 64; });
  }
}

TEST_P(Invariants, AnEmptyBlockIsNoticed) {
  ExpectFault("is empty", [](Place& p) {
    const BlockMask cover = p.block->cover;
    *p.block = TsdfBlock();
    p.block->cover = cover;
    // Its cover is wrong as well, which is found first unless it is put right.
    p.block->cover = {};
  });
}

// Values that are in order by themselves, but that the lists do not know.
TEST_P(ListInvariants, AListThatDoesNotFitTheValuesIsNoticed) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 2);
  const InstanceId id = IsOneField(GetParam()) ? kBackground : kBrick;
  for (const auto& entry : VoxelsOf(*map).GridOf(id)->entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) entry.block->Clear(place);
    entry.block->weight[0] = 1;
    entry.block->distance[0] = ToyConfig().front();
    entry.block->UpdateMasks(ToyConfig().back());
  }
  RenewCovers(*VoxelsOf(*map).GridOf(id));
  const auto fault = VoxelsOf(*map).FindFault();
  ASSERT_TRUE(fault.has_value());
  EXPECT_TRUE(fault->find("is listed at voxel") != std::string::npos ||
              fault->find("the label of voxel") != std::string::npos)
      << *fault;
}

TEST(AnchoredInvariants, AnOrderThatIsNotByDistanceAndAStaleIndexAreNoticed) {
  const auto map = DrivenMap(Method::kTsdfppAnchored, ToyConfig(), 2);
  ASSERT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
  // Where the tray lies on the table both are listed; the second one is made the nearer one.
  bool swapped = false;
  for (const auto& v : VoxelsOf(*map).ListedVoxels()) {
    const auto list = VoxelsOf(*map).ListAt(v);
    if (list.size() < 2 || swapped) continue;
    const Index3 voxel = ToIndex3(v);
    const auto i = static_cast<std::size_t>(PlaceInBlock(voxel));
    TsdfBlock* block = VoxelsOf(*map).GridOf(list[1].id)->Find(BlockOf(voxel));
    if (block == nullptr || map->ObjectLattice(list[1].id).matrix() != Pose::Identity().matrix() ||
        map->ObjectLattice(list[0].id).matrix() != Pose::Identity().matrix() ||
        !Bit(block->band, PlaceInBlock(voxel))) {
      continue;
    }
    const float other = VoxelsOf(*map).ValueAt(list[0].id, v)->distance_m;
    const float nearer = 0.5F * (other - ToyConfig().back());
    if (!(nearer < other && nearer >= -ToyConfig().back())) continue;
    block->distance[i] = nearer;
    swapped = true;
  }
  ASSERT_TRUE(swapped);
  const auto fault = VoxelsOf(*map).FindFault();
  ASSERT_TRUE(fault.has_value());
  EXPECT_NE(fault->find("which is less near"), std::string::npos) << *fault;
}

}  // namespace
}  // namespace tsdfpp
