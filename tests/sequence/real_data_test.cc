// Datasets that we did not write: what their READMEs say of them must hold of what we read.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <sstream>

#include "core/data_folder.h"
#include "core/files.h"
#include "sequence/open_sequence.h"
#include "sequence/pose_matrix.h"
#include "sequence/text_lines.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::SharedData;
using test::TempFolder;

constexpr Intrinsics kRos{640, 480, 525, 525, 319.5, 239.5};

// The median of |depth where `from` says the surface is - depth that `to` measured|, metres.
double MedianWarpError_m(const Frame& from, const Frame& to) {
  const Pose T_to_from = to.T_WC.inverse() * from.T_WC;
  const Intrinsics& k = from.intrinsics;
  std::vector<double> errors;
  for (int y = 0; y < k.height; y += 2) {
    for (int x = 0; x < k.width; x += 2) {
      const double z = from.depth.at<float>(y, x);
      if (z <= 0) continue;
      const Eigen::Vector3d p =
          T_to_from * Eigen::Vector3d((x - k.cx) / k.fx * z, (y - k.cy) / k.fy * z, z);
      const int u = static_cast<int>(std::lround(k.fx * p.x() / p.z() + k.cx));
      const int v = static_cast<int>(std::lround(k.fy * p.y() / p.z() + k.cy));
      if (p.z() <= 0 || u < 0 || v < 0 || u >= k.width || v >= k.height) continue;
      const double seen = to.depth.at<float>(v, u);
      if (seen > 0) errors.push_back(std::abs(p.z() - seen));
    }
  }
  EXPECT_GT(errors.size(), 1000U);
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  return *middle;
}

// Median over the pairs (i, i + 1).
double WarpError_m(FrameSource& source) {
  const SequenceInfo& info = source.info();
  std::vector<double> errors;
  Frame before = source.Read(info.first_index).value();
  for (int i = 1; i < info.frame_count; ++i) {
    Frame now = source.Read(info.first_index + i).value();
    errors.push_back(MedianWarpError_m(before, now));
    before = std::move(now);
  }
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() / 2];
}

Error ErrorOf(const fs::path& path, const SequenceOptions& options = {}) {
  const auto source = OpenSequence(path, options);
  EXPECT_FALSE(source.has_value());
  return source ? Error{} : source.error();
}

void ExpectMentions(const Error& error, const std::string& words) {
  EXPECT_EQ(error.kind, ErrorKind::kData);
  EXPECT_NE(error.message.find(words), std::string::npos) << error.message;
}

// The sets below are put together of links to the shared data.
struct FollowingLinks {
  FollowingLinks() { SetLinkPolicy(LinkPolicy::kAnywhere); }
  ~FollowingLinks() { SetLinkPolicy(LinkPolicy::kInside); }
  FollowingLinks(const FollowingLinks&) = delete;
  FollowingLinks& operator=(const FollowingLinks&) = delete;
};

// tum_fr1_rpy_subset without its poses, which `change` writes.
void CopyOfTum(const fs::path& folder, const std::function<Pose(const Pose&)>& change) {
  const fs::path from = SharedData("tum_fr1_rpy_subset");
  for (const char* name : {"rgb", "depth", "associations.txt"}) {
    fs::create_symlink(fs::absolute(from / name), folder / name);
  }
  std::ifstream in(from / "groundtruth.txt");
  std::ofstream out(folder / "groundtruth.txt");
  out.precision(17);
  for (std::string line; std::getline(in, line);) {
    if (line.front() == '#') continue;
    std::istringstream words(line);
    std::string time;
    double t[3];
    double q[4];
    words >> time >> t[0] >> t[1] >> t[2] >> q[0] >> q[1] >> q[2] >> q[3];
    Pose pose = Pose::Identity();
    pose.linear() = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized().toRotationMatrix();
    pose.translation() = Eigen::Vector3d(t[0], t[1], t[2]);
    pose = change(pose);
    const Eigen::Quaterniond turned(pose.linear());
    out << time << ' ' << pose.translation().transpose() << ' ' << turned.coeffs().transpose()
        << '\n';
  }
}

TEST(RealData, TumAsItIs) {
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  SequenceNotes notes;
  const auto source = OpenSequence(SharedData("tum_fr1_rpy_subset"), {}, &notes);
  ASSERT_TRUE(source.has_value()) << source.error().message;
  const SequenceInfo& info = (*source)->info();
  EXPECT_EQ(info.name, "tum_fr1_rpy_subset");
  EXPECT_EQ(info.frame_count, 60);
  EXPECT_EQ(info.intrinsics, kRos);
  EXPECT_EQ(notes.size(), 2U) << "default intrinsics and no masks are said";
  const Frame frame = (*source)->Read(10).value();
  double deepest = 0;
  cv::minMaxLoc(frame.depth, nullptr, &deepest);
  EXPECT_LT(deepest, 5.95);  // README: 5.9 m at most
  EXPECT_TRUE(frame.mask.empty());
  // README: 10.7 mm with these intrinsics, nearest poses and pairs up to 4 apart.
  constexpr double kPublished_m = 0.0107;
  EXPECT_LT(WarpError_m(**source), kPublished_m);
}

TEST(RealData, TumListsAndAssociationsAgree) {
  const FollowingLinks follow;
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  const TempFolder folder;
  const fs::path from = SharedData("tum_fr1_rpy_subset");
  for (const char* name : {"rgb", "depth", "rgb.txt", "depth.txt", "groundtruth.txt"}) {
    fs::create_symlink(fs::absolute(from / name), folder / name);
  }
  const auto listed = OpenSequence(folder.path()).value();
  const auto associated = OpenSequence(from).value();
  ASSERT_EQ(listed->info().frame_count, 60);
  for (const int i : {0, 31, 59}) {
    const Frame a = listed->Read(i).value();
    const Frame b = associated->Read(i).value();
    EXPECT_EQ(cv::norm(a.colour, b.colour, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(a.depth, b.depth, cv::NORM_INF), 0);
    EXPECT_EQ(a.T_WC.matrix(), b.T_WC.matrix());
    EXPECT_EQ(a.time_s, b.time_s);
  }
}

TEST(RealData, TumInvertedPosesAreNamed) {
  const FollowingLinks follow;
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  const TempFolder folder;
  CopyOfTum(folder.path(), [](const Pose& T) { return T.inverse(); });
  ExpectMentions(ErrorOf(folder.path()), "camera poses look inverted");
  SequenceOptions unchecked;
  unchecked.check = false;
  EXPECT_TRUE(OpenSequence(folder.path(), unchecked).has_value());
}

TEST(RealData, TumMillimetrePositionsAreNamed) {
  const FollowingLinks follow;
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  const TempFolder folder;
  CopyOfTum(folder.path(), [](Pose T) {
    T.translation() *= 1000;
    return T;
  });
  ExpectMentions(ErrorOf(folder.path()), "camera positions look like millimetres");
}

TEST(RealData, TumOpenGlAxesAreNamed) {
  const FollowingLinks follow;
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  const TempFolder folder;
  CopyOfTum(folder.path(), [](Pose T) {
    T.linear() = T.linear() * Eigen::DiagonalMatrix<double, 3>(1, -1, -1);
    return T;
  });
  ExpectMentions(ErrorOf(folder.path()), "OpenGL");
}

TEST(RealData, TumWrongUnitIsNamed) {
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  SequenceOptions options;
  options.depth_units_per_m = 1;
  ExpectMentions(ErrorOf(SharedData("tum_fr1_rpy_subset"), options),
                 "at 1 units a metre, expected 0.05 to 50 m: another unit");
}

TEST(RealData, TumIntrinsicsOfHalfTheResolutionAreNamed) {
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  SequenceOptions options;
  options.intrinsics = Intrinsics{0, 0, 262.5, 262.5, 159.5, 119.5};
  ExpectMentions(ErrorOf(SharedData("tum_fr1_rpy_subset"), options),
                 "the principal point (159.5, 119.5) is far from the middle of the 640x480 image");
  options.intrinsics->width = 320;
  options.intrinsics->height = 240;
  const auto source = OpenSequence(SharedData("tum_fr1_rpy_subset"), options);
  ASSERT_TRUE(source.has_value());
  const auto frame = (*source)->Read(0);
  ASSERT_FALSE(frame.has_value());
  ExpectMentions(frame.error(), "the image is 640x480, expected 320x240 (as was asked for)");
}

// README: median 0.56 mm with fy = -480, 3.0 mm with +480.
TEST(RealData, IclNuimWithDepthFirstAndNegativeFy) {
  TSDFPP_NEEDS_SHARED("icl_nuim_mini");
  SequenceOptions options;
  options.intrinsics = Intrinsics{640, 480, 481.2, -480, 319.5, 239.5};
  const auto source = OpenSequence(SharedData("icl_nuim_mini"), options);
  ASSERT_TRUE(source.has_value()) << source.error().message;
  EXPECT_EQ((*source)->info().frame_count, 3);
  EXPECT_EQ((*source)->info().intrinsics.fy, 480);
  const Frame frame = (*source)->Read(1).value();
  EXPECT_EQ(frame.time_s, 1);
  double nearest = 0;
  double farthest = 0;
  cv::minMaxLoc(frame.depth, &nearest, &farthest);
  EXPECT_NEAR(nearest, 1.90, 0.02);  // README, over the three frames
  EXPECT_LT(farthest, 3.45);
  EXPECT_LT(WarpError_m(**source), 0.001);
  options.intrinsics->fy = 480;
  EXPECT_GT(WarpError_m(*OpenSequence(SharedData("icl_nuim_mini"), options).value()), 0.002);
}

// apc_shelf_scene0000 has 7-Scenes' layout, but 10000 units a metre: 0.09 to 1.9 m.
TEST(RealData, ShelfInSevenScenesLayout) {
  TSDFPP_NEEDS_SHARED("apc_shelf_scene0000");
  const fs::path folder = SharedData("apc_shelf_scene0000");
  ExpectMentions(ErrorOf(folder), "depth looks like 10000 units a metre, it was read as 1000");
  SequenceOptions options;
  options.depth_units_per_m = 10000;
  SequenceNotes notes;
  const auto source = OpenSequence(folder, options, &notes);
  ASSERT_TRUE(source.has_value()) << source.error().message;
  EXPECT_EQ((*source)->info().frame_count, 15);
  EXPECT_EQ((*source)->info().intrinsics,
            (Intrinsics{640, 480, 615.19519, 615.195251, 298.442688, 247.519196}));
  EXPECT_NE(notes.front().find("label.png look like masks and are not read"), std::string::npos);
  EXPECT_LT(WarpError_m(**source), 0.008);  // README: 5.0 mm, pairs 1 and 5 apart
}

// Open3D's frames laid out as ScanNet's: the poses come from its trajectory.log.
void WriteAsScannet(const fs::path& folder, const std::function<Pose(const Pose&)>& change) {
  const fs::path from = SharedData("open3d_redwood5");
  for (const char* name : {"color", "depth"}) {
    fs::create_directory_symlink(fs::absolute(from / name), folder / name);
  }
  const std::vector<double> log = ReadNumbers(from / "trajectory.log").value();
  ASSERT_EQ(log.size(), 5U * 19);
  for (std::size_t i = 0; i < 5; ++i) {
    const auto pose =
        PoseFromNumbers(std::span(log).subspan(19 * i + 3, 16), "trajectory.log").value();
    ASSERT_TRUE(
        WriteFile(folder / fmt::format("pose/{:05d}.txt", i), PoseToMatrixText(change(pose)))
            .has_value());
  }
  ASSERT_TRUE(WriteFile(folder / "intrinsic/intrinsic_depth.txt",
                        "525 0 319.5 0\n0 525 239.5 0\n0 0 1 0\n0 0 0 1\n")
                  .has_value());
}

// README: 5.1 mm as camera-to-world, 39 mm inverted.
TEST(RealData, RedwoodInScannetLayout) {
  const FollowingLinks follow;
  TSDFPP_NEEDS_SHARED("open3d_redwood5");
  const TempFolder folder;
  WriteAsScannet(folder.path(), [](const Pose& T) { return T; });
  const auto source = OpenSequence(folder.path());
  ASSERT_TRUE(source.has_value()) << source.error().message;
  EXPECT_EQ((*source)->info().frame_count, 5);
  EXPECT_EQ((*source)->info().intrinsics, kRos);
  EXPECT_LT(WarpError_m(**source), 0.0051);
}

TEST(RealData, RedwoodInvertedIsNamed) {
  const FollowingLinks follow;
  TSDFPP_NEEDS_SHARED("open3d_redwood5");
  const TempFolder folder;
  WriteAsScannet(folder.path(), [](const Pose& T) { return T.inverse(); });
  ExpectMentions(ErrorOf(folder.path()), "camera poses look inverted");
}

}  // namespace
}  // namespace tsdfpp
