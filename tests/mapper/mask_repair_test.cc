// Masks that are wrong, made right by the map, and its parts: disputed places, new surface, taking
// out. In the toys' analytic world (2 cm voxels), whose true masks are known.
// Longer than most files: the parts one by one, and the whole.
#include "mapper/associate/mask_repair.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <set>

#include "core/pixel_ray.h"
#include "mapper/associate/take_out.h"
#include "mapper/map_file.h"
#include "tests/mapper/every_method.h"

namespace tsdfpp {
namespace {

// --- Disputed places ---------------------------------------------------------------------------

Testimony Said(bool is_own, float observations = 2) { return {1, {0, 0, 0}, is_own, observations}; }

TEST(ContestedCells, ShareIsThatOfTheFramesSinceTheFirstDispute) {
  ContestedCells cells;
  EXPECT_EQ(cells.ShareOf(1, {0, 0, 0}), 1);
  cells.Add({Said(true)});
  EXPECT_FALSE(cells.IsContested(1, {0, 0, 0}));
  cells.Add({Said(false, 3)});
  EXPECT_TRUE(cells.IsContested(1, {0, 0, 0}));
  EXPECT_FALSE(cells.IsContested(1, {0, 0, 1}));
  EXPECT_FALSE(cells.HasAny(2));
  EXPECT_DOUBLE_EQ(cells.ShareOf(1, {0, 0, 0}), 3.0 / 4);
  cells.Add({Said(true)});
  EXPECT_DOUBLE_EQ(cells.ShareOf(1, {0, 0, 0}), 4.0 / 5);
  cells.Add({});
  EXPECT_DOUBLE_EQ(cells.ShareOf(1, {0, 0, 0}), 4.0 / 5);
}

TEST(ContestedCells, AnEighthOfWhatIsSaidIsEnoughForItsObject) {
  ContestedCells cells;
  std::vector<Testimony> said(7, Said(false));
  said.push_back(Said(true));
  cells.Add(said);
  EXPECT_FALSE(cells.IsContested(1, {0, 0, 0}));
  said.insert(said.begin(), Said(false));
  cells.Add(said);
  EXPECT_TRUE(cells.IsContested(1, {0, 0, 0}));
}

TEST(ContestedCells, WhatOthersHadMoreOftenIsLostOnceAndNeverTheBackgrounds) {
  ContestedCells cells;
  cells.Add({Said(false, 1), {2, {5, 0, 0}, false, 9}, {kBackground, {0, 0, 0}, false, 0}});
  EXPECT_TRUE(cells.TakeLost().empty());
  cells.Add({Said(false), {2, {5, 0, 0}, false, 9}});
  const auto lost = cells.TakeLost();
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_EQ(lost.at(1), (std::vector<Index3>{{0, 0, 0}}));
  EXPECT_TRUE(cells.TakeLost().empty());
  EXPECT_FALSE(cells.IsContested(1, {0, 0, 0}));
  EXPECT_TRUE(cells.IsContested(kBackground, {0, 0, 0}));
}

// --- New surface -------------------------------------------------------------------------------

constexpr int kConfirm = 3;
constexpr int kForget = 5;

class NewSurfaceTest : public testing::Test {
 protected:
  // What is confirmed of points in a row along x, `T_WO` the pose of object 1.
  std::vector<bool> See(InstanceId label, const std::vector<double>& x_m,
                        const Pose& T_WO = Pose::Identity()) {
    std::vector<NewPoint> points;
    points.reserve(x_m.size());
    for (const double x : x_m) points.push_back({label, T_WO * Eigen::Vector3d(x, 0.01, 0.01)});
    const ObjectLookup lookup(*map_, ObjectLookup::Of::kObjectsAndBackground);
    return surface_.Confirm(points, ObjectCells({{1, T_WO}}, 0.04), lookup);
  }
  std::unique_ptr<MapRepresentation> map_ = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  NewSurface surface_{kConfirm, kConfirm, kForget};
};

TEST_F(NewSurfaceTest, IsConfirmedWhereItWasSeenOftenEnough) {
  using Answer = std::vector<bool>;
  EXPECT_EQ(See(0, {0.01, 0.05}), (Answer{false, false}));
  EXPECT_EQ(See(0, {0.02}), Answer{false});
  EXPECT_EQ(See(0, {0.03, 0.05}), (Answer{true, false}));  // in one cell; another one
  EXPECT_EQ(See(1, {0.01}), Answer{false});                // of another label
  EXPECT_EQ(See(0, {}), Answer{});
}

TEST_F(NewSurfaceTest, IsForgottenWhereItIsNotSeenForLong) {
  See(0, {0.01});
  See(0, {0.01});
  for (int i = 0; i < kForget; ++i) See(0, {});
  EXPECT_EQ(See(0, {0.01}), std::vector<bool>{false});
  See(0, {0.01});
  for (int i = 1; i < kForget; ++i) See(0, {});
  EXPECT_EQ(See(0, {0.01}), std::vector<bool>{true});
}

TEST_F(NewSurfaceTest, GoesWithItsObject) {
  for (int i = 0; i < kConfirm; ++i) {
    const Pose T_WO = reference::MakePose(0.3 * i, Eigen::Vector3d::UnitZ(), {0.1 * i, 0, 0.02});
    EXPECT_EQ(See(1, {0.01}, T_WO), std::vector<bool>{i + 1 == kConfirm});
  }
}

// An object is born with its greatest part; what lies 2 m off needs ten times the frames.
TEST_F(NewSurfaceTest, OfAnObjectBeginsWithItsGreatestPart) {
  const std::vector<double> all{0.01, 0.17, 0.33, 2.01};
  std::vector<bool> confirmed;
  for (int i = 0; i < kConfirm; ++i) confirmed = See(1, all);
  EXPECT_EQ(confirmed, (std::vector<bool>{true, true, true, false}));
  for (int i = kConfirm; i < kTimesLongerApart * kConfirm; ++i) {
    confirmed = See(1, all);
  }
  EXPECT_EQ(confirmed, (std::vector<bool>{true, true, true, true}));
}

// An object that moves before any tracker can know how is born all the same.
TEST_F(NewSurfaceTest, OfAnObjectThatMovesBeginsWithWhatAFrameShows) {
  for (int i = 1; i < kConfirm; ++i) {
    EXPECT_EQ(See(1, {0.1 * i, 0.1 * i + 0.05}), (std::vector<bool>{false, false}));
  }
  EXPECT_EQ(See(1, {0.5, 0.55, 2.01}), (std::vector<bool>{true, true, false}));
}

// --- Taking out --------------------------------------------------------------------------------

class TakeOutOfMethod : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(TakeOutOfMethod);

TEST_P(TakeOutOfMethod, ClearsTheCellsAndNothingElse) {
  constexpr int kFrames = 4;
  auto map = DrivenMap(GetParam(), ToyConfig(), kFrames);
  const auto before = map->Clone();
  const Pose T_WO = DriveFrame(kFrames - 1).T_WO.at(kBrick);
  const VoxelInspection& voxels = VoxelsOf(*map);
  const VoxelInspection& were = VoxelsOf(*before);
  // About one end of the brick.
  std::vector<Index3> cells;
  for (int y = -3; y < 3; ++y) {
    for (int z = -3; z < 3; ++z) cells.push_back({3, y, z});
  }
  TakeOut(cells, kToyVoxel_m, kBrick, T_WO, *map);
  EXPECT_EQ(voxels.FindFault(), std::nullopt);
  const bool is_one_field = IsOneField(GetParam());
  const Pose T_OL = T_WO.inverse() * before->ObjectLattice(kBrick);
  int cleared = 0;
  for (const Eigen::Vector3i& voxel : were.ObservedVoxels(kBrick)) {
    const Eigen::Vector3d p_O = T_OL * (voxel.cast<double>() * kToyVoxel_m) / kToyVoxel_m;
    const auto value = voxels.ValueAt(kBrick, voxel);
    cleared += value ? 0 : 1;
    // A voxel about a cell, whichever way the lattice is turned against the object.
    const bool is_far = p_O.x() < 1 || p_O.x() > 6;
    if (is_far || is_one_field) {
      ASSERT_TRUE(value.has_value());
      EXPECT_EQ(value->distance_m, were.ValueAt(kBrick, voxel)->distance_m);
    }
    const bool is_inside =
        std::abs(p_O.x() - 3.5) < 0.4 && std::abs(p_O.y()) < 2.5 && std::abs(p_O.z()) < 2.5;
    if (is_inside && !is_one_field) {
      EXPECT_FALSE(value.has_value());
    }
  }
  EXPECT_EQ(cleared > 0, !is_one_field);
  for (const InstanceId other : {kBackground, kBall, kTray}) {
    EXPECT_EQ(voxels.ObservedVoxels(other), were.ObservedVoxels(other));
  }
  // Where the object is stays what it was, and it goes on moving from there.
  const Pose there = before->ObjectLattice(kBrick);
  EXPECT_TRUE(map->ObjectLattice(kBrick).isApprox(there, 1e-9));
}

TEST(TakeOut, ObjectsOfWhichNothingIsLeftGo) {
  auto map = DrivenMap(Method::kTsdfppAnchored, ToyConfig(), 2);
  std::vector<Index3> cells;
  for (int x = -12; x < 12; ++x) {
    for (int y = -12; y < 12; ++y) {
      for (int z = -12; z < 12; ++z) cells.push_back({x, y, z});
    }
  }
  TakeOut(cells, kToyVoxel_m, kBrick, DriveFrame(1).T_WO.at(kBrick), *map);
  EXPECT_EQ(map->Objects(), (std::vector<InstanceId>{kBackground, kBall, kTray}));
  TakeOut(cells, kToyVoxel_m, kBackground, Pose::Identity(), *map);
  TakeOut(cells, kToyVoxel_m, 77, Pose::Identity(), *map);
  EXPECT_EQ(map->Objects(), (std::vector<InstanceId>{kBackground, kBall, kTray}));
  EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
  // What is fused of it next is where it is, and moves with it.
  const Frame frame = DriveFrame(1);
  map->Fuse(frame, frame.mask);
  const TriangleMesh there = map->ObjectMesh(kBrick);
  ASSERT_FALSE(there.vertices.empty());
  Pose up = frame.T_WO.at(kBrick);
  up.translation().z() += 0.1;
  map->SetObjectPose(kBrick, up);
  EXPECT_NEAR(map->ObjectMesh(kBrick).vertices.front().z() - there.vertices.front().z(), 0.1, 1e-6);
}

// Nor does it get a pose by it.
TEST(TakeOut, AnObjectWithoutAPoseHasNoneAfterIt) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  const Frame frame = DriveFrame(1);
  map->Fuse(frame, frame.mask);
  const auto before = VoxelsOf(*map).ObservedVoxels(kBrick);
  ASSERT_FALSE(before.empty());
  const Eigen::Vector3i& some = before[before.size() / 2];
  TakeOut({{some.x(), some.y(), some.z()}}, kToyVoxel_m, kBrick, std::nullopt, *map);
  EXPECT_LT(VoxelsOf(*map).ObservedVoxels(kBrick).size(), before.size());
  map->SetObjectPose(kBrick, frame.T_WO.at(kBrick));
  EXPECT_EQ(map->ObjectLattice(kBrick).matrix(), Pose::Identity().matrix());
}

// --- Whole masks -------------------------------------------------------------------------------

struct Wrong {
  int wrong = 0;    // fused as another's
  int waiting = 0;  // not fused
};

// Maps frames with repaired masks and counts pixels.
class RepairedWorld {
 public:
  explicit RepairedWorld(Method method, const MaskRepairConfig& config = {})
      : map_(MakeMap(method, ToyConfig())), repair_(config) {}

  // `mask` is what is seen of the frame, whose own is the truth.
  Wrong Map(const Frame& frame, const cv::Mat& mask, const std::set<InstanceId>& unplaced = {}) {
    for (const auto& [id, pose] : frame.T_WO) map_->SetObjectPose(id, pose);
    const cv::Mat outlined = repair_.SetOutlines(frame, mask, map_->config().voxel_m);
    labels_ = repair_.Repair(frame, outlined, frame.T_WO, unplaced, *map_);
    map_->Fuse(frame, labels_);
    Wrong wrong;
    for (int v = 0; v < labels_.rows; ++v) {
      for (int u = 0; u < labels_.cols; ++u) {
        if (!IsValidDepth(frame.depth.at<float>(v, u))) continue;
        const InstanceId label = labels_.at<InstanceId>(v, u);
        wrong.waiting += label == kNoInstance ? 1 : 0;
        wrong.wrong += label == kNoInstance || label == frame.mask.at<InstanceId>(v, u) ? 0 : 1;
      }
    }
    return wrong;
  }
  Wrong Map(const Frame& frame) { return Map(frame, frame.mask); }

  const MapRepresentation& map() const { return *map_; }
  const cv::Mat& labels() const { return labels_; }

 private:
  std::unique_ptr<MapRepresentation> map_;
  MaskRepair repair_;
  cv::Mat labels_;
};

// tsdf/static cannot move what it has.
Frame StillFrame(int i) { return RenderToys(TableWithToys(), 0.2 + 0.1 * i, i); }

cv::Mat With(const cv::Mat& mask, InstanceId id, InstanceId other) {
  cv::Mat changed = mask.clone();
  changed.setTo(static_cast<double>(other), mask == static_cast<double>(id));
  return changed;
}

class MaskRepairOfMethod : public EveryMethodTest {
 protected:
  // Pixels of the toys, which have a thousand, that may be wrong in these large voxels: where they
  // stand on the table both explain them.
  static constexpr int kAtContact_px = 60;
  static constexpr int kKnown = 8;  // frames until the map knows the toys
  RepairedWorld world_{GetParam()};
  void Learn() {
    for (int i = 0; i < kKnown; ++i) world_.Map(StillFrame(i));
  }
};
TSDFPP_FOR_EVERY_VOXEL_METHOD(MaskRepairOfMethod);

TEST_P(MaskRepairOfMethod, NothingIsFusedBeforeItIsConfirmed) {
  const Frame first = StillFrame(0);
  const int all = cv::countNonZero(first.depth > 0);
  EXPECT_EQ(world_.Map(first).waiting, all);
  for (int i = 1; i + 1 < MaskRepairConfig{}.confirm_frames; ++i) world_.Map(StillFrame(i));
  EXPECT_EQ(world_.map().Memory().blocks, 0U);
  Wrong last;
  for (int i = 3; i < kKnown; ++i) last = world_.Map(StillFrame(i));
  EXPECT_LT(last.waiting, all / 20);
  EXPECT_LE(last.wrong, kAtContact_px);
}

TEST_P(MaskRepairOfMethod, AnObjectThatTheMaskMissesKeepsItsPixels) {
  Learn();
  const Frame frame = StillFrame(kKnown);
  const cv::Mat missing = With(frame.mask, kBrick, kBackground);
  const int pixels = cv::countNonZero(frame.mask == double{kBrick});
  ASSERT_GT(pixels, 300);
  EXPECT_LE(world_.Map(frame, missing).wrong, kAtContact_px + pixels / 10);
  EXPECT_GT(cv::countNonZero(world_.labels() == double{kBrick}), pixels * 2 / 3);
}

TEST_P(MaskRepairOfMethod, AnObjectWithAnotherIdOrAnothersKeepsItsOwn) {
  Learn();
  const Frame frame = StillFrame(kKnown);
  EXPECT_LE(world_.Map(frame, With(frame.mask, kBrick, 200)).wrong, kAtContact_px);
  EXPECT_EQ(world_.map().Objects(), ToyIds());
  EXPECT_LE(world_.Map(frame, With(frame.mask, kBall, kBrick)).wrong, kAtContact_px);
  EXPECT_EQ(world_.map().Objects(), ToyIds());
}

// Half of the frames call the brick something else, also before the map knows it.
TEST_P(MaskRepairOfMethod, IdsThatFlickerMakeNoObjects) {
  for (int i = 0; i < 16; ++i) {
    const Frame frame = StillFrame(i);
    const auto drawn = static_cast<InstanceId>(100 + i);
    world_.Map(frame, i % 2 == 1 ? With(frame.mask, kBrick, drawn) : frame.mask);
  }
  EXPECT_EQ(world_.map().Objects(), ToyIds());
}

TEST_P(MaskRepairOfMethod, MapsAreTheSameForAnyNumberOfThreads) {
  const auto labels_of = [] {
    RepairedWorld world(GetParam());
    std::vector<cv::Mat> labels;
    for (int i = 0; i < 10; ++i) {
      const Frame frame = StillFrame(i);
      world.Map(frame, i % 3 == 0 ? With(frame.mask, kBrick, kBackground)
                                  : With(frame.mask, kBall, i % 3 == 1 ? kBall : kTray));
      labels.push_back(world.labels().clone());
    }
    return labels;
  };
  const std::vector<cv::Mat> all = labels_of();
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const std::vector<cv::Mat> alone = labels_of();
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ(cv::countNonZero(all[i] != alone[i]), 0);
}

// A piece of the table is given to the ball in the first frames, and to the table in later ones.
class MaskRepairOfVolumes : public MaskRepairOfMethod {
 protected:
  static cv::Mat WithPiece(const Frame& frame) {
    cv::Mat mask = frame.mask.clone();
    for (int v = 0; v < mask.rows; ++v) {
      for (int u = 0; u < mask.cols; ++u) {
        const float depth_m = frame.depth.at<float>(v, u);
        if (mask.at<InstanceId>(v, u) != kBackground || !IsValidDepth(depth_m)) continue;
        const Eigen::Vector3d p_C = double{depth_m} * PixelRay(frame.intrinsics, u, v);
        const Eigen::Vector3d p_B = frame.T_WO.at(kBall).inverse() * (frame.T_WC * p_C);
        if (p_B.head<2>().norm() < 0.12) mask.at<InstanceId>(v, u) = kBall;
      }
    }
    return mask;
  }
  // Vertices of the ball's mesh that are not the ball's.
  int Beside() const {
    int count = 0;
    const Pose T_BW = StillFrame(0).T_WO.at(kBall).inverse();
    for (const auto& vertex : world_.map().ObjectMesh(kBall).vertices) {
      count += (T_BW * vertex.template cast<double>()).norm() > 0.055 + kToyVoxel_m ? 1 : 0;
    }
    return count;
  }
  void LearnWithPiece() {
    for (int i = 0; i < kKnown; ++i) world_.Map(StillFrame(i), WithPiece(StillFrame(i)));
  }
};
TSDFPP_FOR_METHODS(MaskRepairOfVolumes,
                   (std::vector<Method>{Method::kTsdfpp, Method::kTsdfppAnchored,
                                        Method::kVolumes}));

TEST_P(MaskRepairOfVolumes, WhatWasFusedUnderAWrongLabelIsTakenOut) {
  LearnWithPiece();
  const int at_first = Beside();
  EXPECT_GT(at_first, 20);
  for (int i = kKnown; i < 4 * kKnown; ++i) world_.Map(StillFrame(i));
  EXPECT_LT(Beside(), at_first / 4);
  EXPECT_EQ(VoxelsOf(world_.map()).FindFault(), std::nullopt);
}

// What is there need not be where the object is, so it says nothing of the object.
TEST_P(MaskRepairOfVolumes, NothingIsTakenOutOfWhatIsNotKnownToBeThere) {
  LearnWithPiece();
  const auto at_first = VoxelsOf(world_.map()).ObservedVoxels(kBall).size();
  for (int i = kKnown; i < 3 * kKnown; ++i) {
    world_.Map(StillFrame(i), With(StillFrame(i).mask, kBall, kBackground), {kBall});
  }
  EXPECT_GE(VoxelsOf(world_.map()).ObservedVoxels(kBall).size(), at_first);
}

// A mask that is wrong at a few points of each cell is not a dispute: the others are heard as well.
TEST(MaskRepair, AFewPointsDisputeNothing) {
  const auto frame_of = [](int i) {
    return reference::Render(TableWithToys(), CircleCamera(0.2 + 0.1 * i), i,
                             {384, 288, 320.0, 320.0, 191.5, 143.5});
  };
  const auto frames_until_lost = [&](bool is_speckled) {
    RepairedWorld world(Method::kTsdfppAnchored);
    int index = 0;
    for (; index < 6; ++index) world.Map(frame_of(index));
    if (is_speckled) {
      const Frame frame = frame_of(index);
      cv::Mat mask = frame.mask.clone();
      for (int v = 0; v + 1 < mask.rows; v += 15) {
        for (int u = 0; u + 1 < mask.cols; u += 15) {
          cv::Mat speckle = mask(cv::Rect(u, v, 2, 2));
          speckle.setTo(static_cast<double>(kTray), speckle == static_cast<double>(kBrick));
        }
      }
      EXPECT_GT(cv::countNonZero(mask != frame.mask), 20);
      world.Map(frame, mask);
    } else {
      world.Map(frame_of(index));
    }
    const auto at_first = VoxelsOf(world.map()).ObservedVoxels(kBrick).size();
    for (int frames = 1; frames < 30; ++frames) {
      const Frame frame = frame_of(index + frames);
      world.Map(frame, With(frame.mask, kBrick, kBackground));
      if (VoxelsOf(world.map()).ObservedVoxels(kBrick).size() < at_first) return frames;
    }
    return 30;
  };
  const int without = frames_until_lost(false);
  EXPECT_LT(without, 30);
  EXPECT_EQ(frames_until_lost(true), without);
}

// --- Settings ----------------------------------------------------------------------------------

TEST(MaskRepairConfig, ReadsWhatItWrites) {
  MaskRepairConfig config;
  config.keep_voxels = 1.5;
  config.take_voxels = 0.25;
  config.sigma_voxels = 0.7;
  config.own_factor = 3;
  config.cell_voxels = 4;
  config.confirm_frames = 2;
  config.forget_frames = 7;
  const auto read = MaskRepairConfig::FromToml(config.ToToml(), "t.toml");
  ASSERT_TRUE(read.has_value()) << read.error().message;
  EXPECT_EQ(*read, config);
  EXPECT_EQ(*MaskRepairConfig::FromToml(toml::table{}, "t.toml"), MaskRepairConfig{});
}

TEST(MaskRepairConfig, RefusesWhatItCannotDo) {
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"keep_voxels = 0", "keep_voxels"},
      {"take_voxels = 1.1", "take_voxels"},
      {"keep_voxels = 0.1", "expected at most 'keep_voxels', which is 0.1"},
      {"sigma_voxels = nan", "sigma_voxels"},
      {"own_factor = 0.5", "own_factor"},
      {"cell_voxels = 0", "cell_voxels"},
      {"confirm_frames = 0", "confirm_frames"},
      {"forget_frames = 0", "forget_frames"},
      {"forget = 3", "forget"},
      {"confirm_frames = 'four'", "confirm_frames"}};
  for (const auto& [text, named] : wrong) {
    const auto config = MaskRepairConfig::FromToml(toml::parse(text), "t.toml");
    ASSERT_FALSE(config.has_value()) << text;
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    EXPECT_NE(config.error().message.find(named), std::string::npos) << config.error().message;
    EXPECT_NE(config.error().message.find("t.toml"), std::string::npos);
  }
}

}  // namespace
}  // namespace tsdfpp
