// What must not matter to a map: where the world's origin is, what objects are called, the order in
// which a world that stands still is looked at, poses that come back, a second removal.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "mapper/map_file.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/dyadic_scene.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/map_snapshot.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

class MapSymmetries : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(MapSymmetries);

TEST_P(MapSymmetries, AWorldShiftedByBlocksIsTheSameBitForBit) {
  constexpr int kFrames = 4;
  const auto map = DyadicMap(GetParam(), kFrames);
  ASSERT_GT(VoxelsOf(*map).ListedVoxels().size(), 1000U);
  for (const Index3& blocks : {Index3{1, 0, 0}, Index3{-1000, 2000, 37}, Index3{3, -4096, -513}}) {
    const auto shifted = DyadicMap(GetParam(), kFrames, blocks);
    EXPECT_TRUE(SameContentShifted(*map, *shifted, blocks));
    EXPECT_EQ(shifted->Memory().blocks, map->Memory().blocks);
  }
  // A voxel more is another map: the comparison can fail.
  Frame off = DyadicFrame(0);
  off.T_WC.translation().x() += kDyadicVoxel_m;
  const auto other = MakeMap(GetParam(), DyadicConfig());
  PoseAndFuse(*other, off);
  EXPECT_FALSE(SameContentShifted(*DyadicMap(GetParam(), 1), *other, {}));
}

// How two maps of the same frames differ, over the voxels that either has observed of any toy.
struct Difference {
  std::size_t voxels = 0;
  std::size_t other = 0;   // observed in one alone, or further apart than the bound
  double mean_voxels = 0;  // of the distances where both are observed
  double share() const { return static_cast<double>(other) / static_cast<double>(voxels); }
};

Difference DifferenceOf(const MapRepresentation& a, const MapRepresentation& b,
                        const Eigen::Vector3i& shift, double bound_voxels) {
  Difference difference;
  std::size_t both = 0;
  for (const InstanceId id : ToyIds()) {
    std::vector<Eigen::Vector3i> voxels = VoxelsOf(a).ObservedVoxels(id);
    for (const Eigen::Vector3i& v : VoxelsOf(b).ObservedVoxels(id)) {
      if (!VoxelsOf(a).ValueAt(id, v - shift)) voxels.emplace_back(v - shift);
    }
    for (const Eigen::Vector3i& v : voxels) {
      const auto in_a = VoxelsOf(a).ValueAt(id, v);
      const auto in_b = VoxelsOf(b).ValueAt(id, v + shift);
      ++difference.voxels;
      if (!in_a || !in_b) {
        ++difference.other;
        continue;
      }
      const double apart =
          std::abs(double{in_a->distance_m} - in_b->distance_m) / a.config().voxel_m;
      difference.mean_voxels += apart;
      ++both;
      if (apart > bound_voxels) ++difference.other;
    }
  }
  difference.mean_voxels /= static_cast<double>(std::max<std::size_t>(both, 1));
  return difference;
}

// Coordinates of single precision: 4096 voxels from the origin they are rounded to 2^-12 voxels,
// which moves a projected voxel by some thousandths of a pixel. So of a thousand voxels some fall
// on the next pixel, whose depth is another one.
constexpr double kShiftBound_voxels = 0.02;
constexpr double kShiftMean_voxels = 0.01;
constexpr double kShiftShare = 0.03;

TEST_P(MapSymmetries, AnyOtherShiftIsTheSameWithinABound) {
  const Index3 blocks{512, -300, 100};
  const auto map = MakeMap(GetParam(), ToyConfig());
  const auto shifted = MakeMap(GetParam(), ToyConfig());
  for (int i = 0; i < 4; ++i) {
    PoseAndFuse(*map, DriveFrame(i));
    PoseAndFuse(*shifted, Shifted(DriveFrame(i), blocks, kToyVoxel_m));
  }
  const Eigen::Vector3i shift = kBlockSide * Eigen::Vector3i(blocks.x, blocks.y, blocks.z);
  const Difference difference = DifferenceOf(*map, *shifted, shift, kShiftBound_voxels);
  EXPECT_GT(difference.voxels, 5000U);
  EXPECT_LT(difference.share(), kShiftShare);
  EXPECT_LT(difference.mean_voxels, kShiftMean_voxels);
}

// Each toy gets the name of the next; the background is not a toy.
const std::map<InstanceId, InstanceId> kOtherNames{
    {kBackground, kBackground}, {kBrick, kBall}, {kBall, kTray}, {kTray, kBrick}};

Frame Renamed(const Frame& frame) {
  Frame renamed = frame;
  renamed.mask = frame.mask.clone();
  renamed.T_WO.clear();
  for (const auto& [from, to] : kOtherNames) {
    renamed.mask.setTo(to, frame.mask == from);
    if (frame.T_WO.contains(from)) renamed.T_WO[to] = frame.T_WO.at(from);
  }
  return renamed;
}

// Where the order of ids decides: voxels that two toys reach for in the same frame. They stand
// apart, so that these are few.
constexpr double kTiedShare = 0.005;

TEST_P(MapSymmetries, PermutedIdsPermuteLabels) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  const auto renamed = MakeMap(GetParam(), ToyConfig());
  for (int i = 0; i < 4; ++i) {
    PoseAndFuse(*map, DriveFrame(i));
    PoseAndFuse(*renamed, Renamed(DriveFrame(i)));
  }
  std::size_t voxels = 0;
  std::size_t tied = 0;
  for (const auto& [from, to] : kOtherNames) {
    const auto observed = VoxelsOf(*map).ObservedVoxels(from);
    EXPECT_FALSE(observed.empty());
    voxels += observed.size();
    for (const Eigen::Vector3i& v : observed) {
      if (!SameBits(VoxelsOf(*renamed).ValueAt(to, v), VoxelsOf(*map).ValueAt(from, v))) ++tied;
    }
    const auto missed = std::ptrdiff_t(VoxelsOf(*renamed).ObservedVoxels(to).size()) -
                        std::ptrdiff_t(observed.size());
    tied += static_cast<std::size_t>(std::abs(missed));
  }
  EXPECT_LE(static_cast<double>(tied), kTiedShare * static_cast<double>(voxels));
  // Object volumes do not know each other.
  if (!IsOneField(GetParam()) && GetParam() != Method::kTsdfppLiteral) {
    EXPECT_EQ(tied, 0U);
  }

  const auto listed = VoxelsOf(*map).ListedVoxels();
  std::size_t different = 0;
  for (const Eigen::Vector3i& v : listed) {
    std::vector<Listing> expected = VoxelsOf(*map).ListAt(v);
    for (Listing& listing : expected) listing.id = kOtherNames.at(listing.id);
    const std::vector<Listing> actual = VoxelsOf(*renamed).ListAt(v);
    if (actual != expected) ++different;
  }
  EXPECT_LE(static_cast<double>(different), kTiedShare * static_cast<double>(listed.size()));
  EXPECT_EQ(VoxelsOf(*map).ObservedVoxels(kBackground).size(),
            VoxelsOf(*renamed).ObservedVoxels(kBackground).size());
}

TEST_P(MapSymmetries, APoseThatComesBackLeavesTheSameBytes) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  // Not at its birth any more.
  for (int i = 0; i < 3; ++i) PoseAndFuse(*map, DriveFrame(i));
  const Frame last = DriveFrame(2);
  const std::string file = MapToBytes(*map).value();
  const std::string seen = SnapshotOf(*map, ToyIds());
  Dice dice(23);
  for (int i = 0; i < 7; ++i) {
    for (const InstanceId id : {kBrick, kTray}) {
      map->SetObjectPose(id, MakePose(dice.Uniform(-3, 3), {dice.Uniform(-1, 1), 0.2, 0.7},
                                      {dice.Uniform(-0.2, 0.2), dice.Uniform(-0.2, 0.2), 0.05}));
    }
    if (i % 3 == 0) map->SceneMesh();  // what is kept between must not show
  }
  EXPECT_FALSE(MapToBytes(*map).value() == file);
  for (const InstanceId id : {kBrick, kTray}) map->SetObjectPose(id, last.T_WO.at(id));
  // Where values move, each move loses some; where poses move nothing, none does.
  const bool same = MovesLattices(GetParam()) || GetParam() == Method::kTsdfStatic;
  EXPECT_EQ(MapToBytes(*map).value() == file, same);
  EXPECT_EQ(SnapshotOf(*map, ToyIds()) == seen, same);
}

const std::vector<std::vector<int>>& Orders() {
  static const std::vector<std::vector<int>> orders{
      {0, 1, 2, 3, 4, 5}, {5, 4, 3, 2, 1, 0}, {3, 0, 5, 1, 4, 2}};
  return orders;
}
constexpr int kStillFrames = 6;

void FuseInOrder(MapRepresentation& map, const std::vector<int>& order) {
  ASSERT_EQ(order.size(), std::size_t{kStillFrames});
  for (const int i : order) PoseAndFuse(map, RenderToys(TableWithToys(), 0.1 + 0.5 * i, i));
}

// Means of half-precision numbers: each frame rounds one by up to half a unit in its last place,
// which for distances over 2^-4 m is 2^-15 m, 0.0015 voxels of 2 cm; the frames are fused twice,
// and two maps are compared.
constexpr double kOrderBound_voxels = 2 * 2 * kStillFrames * 0.0015;
// Where labels are voted for, the last votes count most: whose a voxel between two objects is.
constexpr double kVoteShare = 0.1;

// Once all blocks are there, and without the rules that ask what came before.
TEST_P(MapSymmetries, FramesInAnotherOrderAreTheSameMean) {
  MapConfig config = ToyConfig();
  config.contradiction = config.rims = false;
  std::vector<std::unique_ptr<MapRepresentation>> maps;
  for (const auto& order : Orders()) {
    auto& map = maps.emplace_back(MakeMap(GetParam(), config));
    FuseInOrder(*map, Orders()[0]);
    FuseInOrder(*map, order);
  }
  for (std::size_t k = 1; k < maps.size(); ++k) {
    const Difference difference =
        DifferenceOf(*maps[0], *maps[k], Eigen::Vector3i::Zero(), kOrderBound_voxels);
    EXPECT_GT(difference.voxels, 5000U);
    if (GetParam() == Method::kTsdfpp || MovesLattices(GetParam())) {
      EXPECT_EQ(difference.other, 0U) << k;
    } else {
      EXPECT_LT(difference.share(), kVoteShare) << k;
    }
  }
}

// What depends on the order by its rule: a block is there, and observed, from the first frame on
// that has its surface; votes; contradiction, which clears what was seen before; the completion of
// rims, which asks what is there already. The voxels that all this leaves apart are of edges.
constexpr double kOrderShare = 0.25;
constexpr double kOrderMean_voxels = 0.15;

TEST_P(MapSymmetries, FramesOfAStillWorldInAnotherOrderAgreeWithinABound) {
  std::vector<std::unique_ptr<MapRepresentation>> maps;
  for (const auto& order : Orders()) {
    FuseInOrder(*maps.emplace_back(MakeMap(GetParam(), ToyConfig())), order);
  }
  for (std::size_t k = 1; k < maps.size(); ++k) {
    const Difference difference =
        DifferenceOf(*maps[0], *maps[k], Eigen::Vector3i::Zero(), kOrderBound_voxels);
    EXPECT_GT(difference.voxels, 5000U);
    EXPECT_LT(difference.share(), kOrderShare) << k;
    EXPECT_LT(difference.mean_voxels, kOrderMean_voxels) << k;
  }
}

TEST_P(MapSymmetries, RemovingTwiceIsRemovingOnce) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 3);
  const std::string whole = MapToBytes(*map).value();
  map->Remove(kNoInstance - 1);
  EXPECT_TRUE(MapToBytes(*map).value() == whole) << "an unknown object was removed";
  for (const InstanceId id : {kBrick, kBackground, kTray}) {
    map->Remove(id);
    const std::string once = MapToBytes(*map).value();
    const std::string seen = SnapshotOf(*map, ToyIds());
    EXPECT_FALSE(once == whole);
    map->Remove(id);
    EXPECT_TRUE(MapToBytes(*map).value() == once) << "object " << id;
    EXPECT_TRUE(SnapshotOf(*map, ToyIds()) == seen) << "object " << id;
    EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
  }
  // And leaves nothing behind that shows later.
  const auto once = DrivenMap(GetParam(), ToyConfig(), 3);
  const auto twice = once->Clone();
  once->Remove(kBrick);
  for (int i = 0; i < 2; ++i) twice->Remove(kBrick);
  for (const auto& of : {once.get(), twice.get()}) PoseAndFuse(*of, DriveFrame(3));
  EXPECT_TRUE(MapToBytes(*twice).value() == MapToBytes(*once).value());
}

}  // namespace
}  // namespace tsdfpp
