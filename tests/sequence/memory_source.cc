#include "tests/sequence/memory_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "core/pose_text.h"
#include "core/random.h"

namespace tsdfpp::test {
namespace {

// The depths that are easiest to lose on the way.
constexpr float kAwkward[] = {0.0F,
                              -0.0F,
                              std::numeric_limits<float>::denorm_min(),
                              std::numeric_limits<float>::min() / 3,
                              std::numeric_limits<float>::infinity(),
                              std::numeric_limits<float>::quiet_NaN(),
                              -1.5F,
                              100.0F,
                              100.00001F,
                              1.0F / 3};

Pose SomePose(int index, std::uint32_t stream) {
  const auto u = UniformDraw(5, stream, static_cast<std::uint64_t>(index));
  const auto v = UniformDraw(6, stream, static_cast<std::uint64_t>(index));
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond(u[0] - 0.5, u[1] - 0.5, u[2] - 0.5, u[3] - 0.5)
                      .normalized()
                      .toRotationMatrix();
  pose.translation() = Eigen::Vector3d(v[0] - 0.5, v[1], -3 * v[2]);
  return PoseThroughText(pose);
}

void ExpectSameImage(const cv::Mat& a, const cv::Mat& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  if (a.empty()) return;
  ASSERT_EQ(a.type(), b.type()) << what;
  const auto row_bytes = static_cast<std::size_t>(a.cols) * a.elemSize();
  for (int y = 0; y < a.rows; ++y) {
    EXPECT_EQ(std::memcmp(a.ptr(y), b.ptr(y), row_bytes), 0) << what << " row " << y;
  }
}

}  // namespace

MemorySource::MemorySource(int frames, int first) {
  info_.name = "noise";
  info_.intrinsics = {13, 7, 564.3, 1.0 / 3, 6.123456789012345, 3.1};
  info_.first_index = first;
  info_.frame_count = frames;
  info_.rate_hz = 29.97;
  info_.objects = {{0, "background", "background"},
                   {1, "toy-truck", "truck"},
                   {2, "car", ""},
                   {7, "mug", "cup"}};
  info_.reveal = RevealPlan{first + 1, {1, 2}};
  for (const ObjectInfo& object : info_.objects) {
    TrueModel model;
    model.info = object;
    const auto shift = static_cast<float>(object.id) / 3;
    model.mesh_O.vertices = {{shift, 0, 0}, {1, shift, 0}, {0, 1, shift}, {1, 1, 1}};
    model.mesh_O.triangles = {{0, 1, 2}, {1, 3, 2}};
    model.regions = {"top", "the rest"};
    model.face_region = {1, 0};
    models_.push_back(model);
  }
}

Expected<Frame> MemorySource::Read(int index) {
  Frame frame;
  frame.index = index;
  frame.time_s = (index - info_.first_index) / info_.rate_hz;
  frame.intrinsics = info_.intrinsics;
  const cv::Size size(info_.intrinsics.width, info_.intrinsics.height);
  frame.colour.create(size, CV_8UC3);
  frame.depth.create(size, CV_32FC1);
  frame.mask.create(size, CV_16UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto pixel = static_cast<std::uint32_t>(y * size.width + x);
      const auto u = UniformDraw(1, pixel, static_cast<std::uint64_t>(index));
      for (int c = 0; c < 3; ++c) {
        frame.colour.at<cv::Vec3b>(y, x)[c] =
            static_cast<std::uint8_t>(256 * u[static_cast<std::size_t>(c)]);
      }
      frame.depth.at<float>(y, x) =
          pixel < std::size(kAwkward) ? kAwkward[pixel] : static_cast<float>(5 * u[3]);
      constexpr InstanceId kIds[] = {0, 1, 2, 7, 255};
      frame.mask.at<InstanceId>(y, x) = kIds[static_cast<std::size_t>(5 * u[0])];
    }
  }
  frame.T_WC = SomePose(index, 0);
  frame.T_WO[1] = SomePose(index, 1);
  if (index > info_.first_index) frame.T_WO[2] = SomePose(index, 2);
  if (on_read) TSDFPP_RETURN_IF_ERROR(on_read(frame));
  return frame;
}

GeneratorInfo SomeGenerator() {
  return {"0.1.0", 18446744073709551615U, "nguyen", "egl", "llvmpipe (LLVM 15.0.6, 256 bits)"};
}

void ExpectSame(const Frame& a, const Frame& b) {
  EXPECT_EQ(a.index, b.index);
  EXPECT_EQ(a.time_s, b.time_s);
  EXPECT_EQ(a.intrinsics, b.intrinsics);
  ExpectSameImage(a.colour, b.colour, "colour");
  ExpectSameImage(a.depth, b.depth, "depth");
  ExpectSameImage(a.mask, b.mask, "mask");
  EXPECT_EQ(a.T_WC.matrix(), b.T_WC.matrix());
  ASSERT_EQ(a.T_WO.size(), b.T_WO.size());
  for (const auto& [id, pose] : a.T_WO) {
    ASSERT_TRUE(b.T_WO.contains(id)) << id;
    EXPECT_EQ(pose.matrix(), b.T_WO.at(id).matrix()) << id;
  }
}

void ExpectSame(const SequenceInfo& a, const SequenceInfo& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.intrinsics, b.intrinsics);
  EXPECT_EQ(a.first_index, b.first_index);
  EXPECT_EQ(a.frame_count, b.frame_count);
  EXPECT_EQ(a.rate_hz, b.rate_hz);
  EXPECT_EQ(a.objects, b.objects);
  EXPECT_EQ(a.reveal, b.reveal);
}

void ExpectSame(const TrueModel& a, const TrueModel& b) {
  EXPECT_EQ(a.info, b.info);
  EXPECT_EQ(a.mesh_O.vertices, b.mesh_O.vertices);
  EXPECT_EQ(a.mesh_O.triangles, b.mesh_O.triangles);
  EXPECT_EQ(a.regions, b.regions);
  EXPECT_EQ(a.face_region, b.face_region);
}

}  // namespace tsdfpp::test
