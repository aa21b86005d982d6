#include <gtest/gtest.h>

#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/foreign_set.h"

namespace tsdfpp {
namespace {

using test::TempFolder;

TEST(CofusionForeign, InfoComesFromTheFilesThemselves) {
  const TempFolder folder;
  test::WriteForeignSet(folder / "room");
  const auto source = OpenSequence(folder / "room/");
  ASSERT_TRUE(source.has_value()) << source.error().message;
  const SequenceInfo& info = (*source)->info();
  EXPECT_EQ(info.name, "room");
  EXPECT_EQ(info.intrinsics, (Intrinsics{8, 6, 9, 9, 3.75, 2.5}));
  EXPECT_EQ(info.first_index, 0);
  EXPECT_EQ(info.frame_count, 3);
  EXPECT_EQ(info.rate_hz, 30);
  EXPECT_FALSE(info.reveal.has_value());
  EXPECT_EQ(info.objects, (std::vector<ObjectInfo>{{0, "background", "background"},
                                                   {1, "ship", "ship"},
                                                   {2, "car", "car"},
                                                   {3, "car3", "car"},
                                                   {5, "object5", ""}}));
}

TEST(CofusionForeign, FramesAreRead) {
  const TempFolder folder;
  test::WriteForeignSet(folder / "room");
  const auto source = OpenSequence(folder / "room").value();
  const Frame frame = source->Read(2).value();
  EXPECT_EQ(frame.index, 2);
  EXPECT_EQ(frame.time_s, 2 / 30.0);
  ASSERT_EQ(frame.colour.type(), CV_8UC3);
  EXPECT_EQ(frame.colour.at<cv::Vec3b>(3, 3), cv::Vec3b(30, 20, 12));
  ASSERT_EQ(frame.depth.type(), CV_32FC1);
  EXPECT_EQ(cv::countNonZero(frame.depth == 3.25F), 48);
  ASSERT_EQ(frame.mask.type(), CV_16UC1);
  EXPECT_EQ(frame.mask.at<InstanceId>(0, 1), 1);
  EXPECT_EQ(frame.mask.at<InstanceId>(2, 3), 2);
  EXPECT_EQ(frame.mask.at<InstanceId>(5, 7), 5);
  EXPECT_EQ(cv::countNonZero(frame.mask), 3);
  EXPECT_EQ(frame.T_WC.translation(), Eigen::Vector3d(1, 0, 0));
  EXPECT_TRUE(frame.T_WC.linear().col(0).isApprox(Eigen::Vector3d::UnitY()));
  ASSERT_EQ(frame.T_WO.size(), 1U) << "the cars have no pose here";
  EXPECT_EQ(frame.T_WO.at(1).translation(), Eigen::Vector3d(1, 2, 4));
  EXPECT_FALSE(source->Read(1)->T_WO.contains(1)) << "the ship's gap";
  EXPECT_EQ(source->Read(0)->T_WO.size(), 3U);
}

TEST(CofusionForeign, VariantsAreAccepted) {
  const TempFolder folder;
  const auto set = folder / "room";
  test::WriteForeignSet(set);
  // Size given, one-channel depth, grey masks, colour with alpha, from number 1 on.
  ASSERT_TRUE(WriteFile(set / "calibration.txt", "9 9 4 3\t8 6").has_value());
  std::filesystem::remove(set / "colour/Color0000.png");
  test::WriteImage(set / "depth_original/Depth0001.exr", cv::Mat(6, 8, CV_32FC1, cv::Scalar(2)));
  test::WriteImage(set / "mask_id/Mask0001.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(2)));
  test::WriteImage(set / "colour/Color0001.png", cv::Mat(6, 8, CV_8UC4, cv::Scalar(1, 2, 3, 4)));
  const auto source = OpenSequence(set).value();
  EXPECT_EQ(source->info().first_index, 1);
  EXPECT_EQ(source->info().frame_count, 2);
  const Frame frame = source->Read(1).value();
  EXPECT_EQ(cv::countNonZero(frame.depth == 2.0F), 48);
  EXPECT_EQ(cv::countNonZero(frame.mask == 2), 48);
  EXPECT_EQ(frame.colour.at<cv::Vec3b>(0, 0), cv::Vec3b(3, 2, 1));
}

TEST(CofusionForeign, WithoutMasksFramesHaveNone) {
  const TempFolder folder;
  test::WriteForeignSet(folder / "room");
  std::filesystem::remove_all(folder / "room/mask_id");
  const auto source = OpenSequence(folder / "room").value();
  EXPECT_TRUE(source->Read(0)->mask.empty());
  EXPECT_EQ(source->info().objects.size(), 4U);
}

TEST(CofusionForeign, FarAndInvalidDepthIsNotMillimetres) {
  const TempFolder folder;
  test::WriteForeignSet(folder / "room");
  // A renderer's far plane over half the image, nothing over the other half.
  cv::Mat depth(6, 8, CV_32FC1, cv::Scalar(1e10));
  depth.rowRange(0, 2) = 0.0F;
  depth.row(2) = std::numeric_limits<float>::infinity();
  test::WriteImage(folder / "room/depth_original/Depth0000.exr", depth);
  const auto frame = OpenSequence(folder / "room").value()->Read(0);
  ASSERT_TRUE(frame.has_value()) << frame.error().message;
  EXPECT_EQ(frame->depth.at<float>(5, 5), 1e10F);
}

}  // namespace
}  // namespace tsdfpp
