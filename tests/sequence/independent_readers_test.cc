// Exports read by readers that share no code with ours, each written from docs/sources.md, "Dataset
// formats".
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>

#include "sequence/export.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"
#include "tests/sequence/independent_bop.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::BoxSource;
using test::TempFolder;

void Export(FrameSource& source, DatasetFormat format, const fs::path& out) {
  const auto report = ExportSequence(source, format, out);
  ASSERT_TRUE(report.has_value()) << report.error().message;
}

// Colours as OpenCV has them: blue first.
void ExpectColour(const cv::Mat& bgr, const Frame& frame) {
  ASSERT_EQ(bgr.size(), frame.colour.size());
  for (int y = 0; y < bgr.rows; ++y) {
    for (int x = 0; x < bgr.cols; ++x) {
      const auto& rgb = frame.colour.at<cv::Vec3b>(y, x);
      ASSERT_EQ(bgr.at<cv::Vec3b>(y, x), cv::Vec3b(rgb[2], rgb[1], rgb[0]));
    }
  }
}

void ExpectDepth(const cv::Mat& units, double units_per_m, const Frame& frame) {
  ASSERT_EQ(units.type(), CV_16UC1);
  for (int y = 0; y < units.rows; ++y) {
    for (int x = 0; x < units.cols; ++x) {
      ASSERT_NEAR(units.at<std::uint16_t>(y, x) / units_per_m, frame.depth.at<float>(y, x),
                  0.5 / units_per_m + 1e-7);
    }
  }
}

TEST(IndependentReaders, Bop) {
  const TempFolder folder;
  BoxSource source;
  Export(source, DatasetFormat::kBop, folder / "out");
  const fs::path scene = folder / "out/test/000000";
  int cut = 0;
  for (int i = 0; i < source.info().frame_count; ++i) {
    const Frame frame = source.Read(i).value();
    const test::BopImage image = test::ReadBopImage(scene, i);
    ExpectColour(image.bgr, frame);
    EXPECT_EQ(image.K, cv::Matx33d(60, 0, 31.25, 0, 61, 23.75, 0, 0, 1));
    ASSERT_EQ(image.objects.size(), 2U);
    cv::Mat explained = cv::Mat::zeros(frame.mask.size(), CV_8UC1);
    for (const test::BopObject& object : image.objects) {
      explained += object.mask_visib / 255;
      const auto model =
          test::BopModelVertices(folder / fmt::format("out/models/obj_{:06d}.ply", object.obj_id));
      ASSERT_EQ(model.size(), 8U);
      // The corners of the box by its own poses, against those by BOP's.
      const Pose T_CO =
          frame.T_WC.inverse() * frame.T_WO.at(static_cast<InstanceId>(object.obj_id));
      for (const cv::Vec3f& corner : model) {
        const cv::Vec3d mm(corner[0], corner[1], corner[2]);
        const cv::Vec3d by_bop = object.R_m2c * mm + object.t_mm;
        const Eigen::Vector3d by_us = T_CO * (Eigen::Vector3d(mm[0], mm[1], mm[2]) / 1000) * 1000;
        EXPECT_LT(cv::norm(by_bop - cv::Vec3d(by_us.x(), by_us.y(), by_us.z())), 1e-6);
      }
      const long visible = cv::countNonZero(object.mask_visib);
      const long whole = cv::countNonZero(object.mask);
      EXPECT_EQ(visible, cv::countNonZero(frame.mask == object.obj_id));
      EXPECT_EQ(cv::countNonZero(object.mask_visib & ~object.mask), 0)
          << "what is visible is part of the silhouette";
      EXPECT_EQ(object.info.at("px_count_visib").get<long>(), visible);
      EXPECT_GE(object.info.at("px_count_all").get<long>(), whole);
      EXPECT_EQ(object.info.at("px_count_valid").get<long>(), whole);
      EXPECT_DOUBLE_EQ(object.info.at("visib_fract").get<double>(),
                       static_cast<double>(visible) / object.info.at("px_count_all").get<double>());
      if (visible < whole) ++cut;
      // Nothing is before the right box.
      if (object.obj_id == 8) {
        EXPECT_EQ(visible, whole);
      }
    }
    EXPECT_EQ(cv::countNonZero(explained > 1), 0) << "visible masks do not overlap";
    // Depth, carried into the world by BOP's camera, lies on the wall where nothing else is.
    for (int y = 0; y < frame.mask.rows; ++y) {
      for (int x = 0; x < frame.mask.cols; ++x) {
        if (frame.mask.at<InstanceId>(y, x) != 0) continue;
        const double z = image.depth_mm.at<double>(y, x);
        const cv::Vec3d p_C((x - image.K(0, 2)) / image.K(0, 0) * z,
                            (y - image.K(1, 2)) / image.K(1, 1) * z, z);
        const cv::Vec3d p_W = image.R_w2c.t() * (p_C - image.t_w2c_mm);
        ASSERT_NEAR(p_W[2], 1500, 0.1) << "half a unit of 0.1 mm along a slanted ray";
      }
    }
  }
  EXPECT_GT(cut, 0) << "the left box is hidden in part";
  const auto infos = test::BopJson(folder / "out/models/models_info.json");
  EXPECT_NEAR(infos.at("3").at("diameter").get<double>(), 2 * std::hypot(100, 80, 60), 1e-4);
  EXPECT_NEAR(infos.at("8").at("min_y").get<double>(), -80, 1e-4);
  EXPECT_NEAR(infos.at("8").at("size_z").get<double>(), 120, 1e-4);
}

// The silhouette of a box is the pixels whose ray meets it, found by slabs in BoxSource.
TEST(IndependentReaders, BopSilhouetteIsWhatRaysHit) {
  const TempFolder folder;
  BoxSource source(1);
  Export(source, DatasetFormat::kBop, folder / "out");
  const Frame frame = source.Read(0).value();
  const test::BopImage image = test::ReadBopImage(folder / "out/test/000000", 0);
  for (const test::BopObject& object : image.objects) {
    if (object.obj_id != 8) continue;
    EXPECT_EQ(cv::countNonZero((frame.mask == 8) != object.mask), 0);
  }
}

TEST(IndependentReaders, Tum) {
  const TempFolder folder;
  BoxSource source;
  Export(source, DatasetFormat::kTum, folder / "out");
  const fs::path out = folder / "out";
  std::ifstream rgb(out / "rgb.txt");
  std::ifstream depth(out / "depth.txt");
  std::ifstream truth(out / "groundtruth.txt");
  const auto next = [](std::ifstream& in) {
    std::string line;
    while (std::getline(in, line) && line.front() == '#') {
    }
    return std::istringstream(line);
  };
  for (int i = 0; i < source.info().frame_count; ++i) {
    const Frame frame = source.Read(i).value();
    double t[3];
    std::string colour_file;
    std::string depth_file;
    next(rgb) >> t[0] >> colour_file;
    next(depth) >> t[1] >> depth_file;
    double tx;
    double ty;
    double tz;
    double qx;
    double qy;
    double qz;
    double qw;
    next(truth) >> t[2] >> tx >> ty >> tz >> qx >> qy >> qz >> qw;
    EXPECT_NEAR(t[0], i / 30.0, 1e-6);
    EXPECT_EQ(t[0], t[1]);
    EXPECT_EQ(t[0], t[2]);
    ExpectColour(cv::imread((out / colour_file).string()), frame);
    ExpectDepth(cv::imread((out / depth_file).string(), cv::IMREAD_UNCHANGED), 5000, frame);
    // A nanometre, as the text has nine decimals.
    EXPECT_LT((frame.T_WC.translation() - Eigen::Vector3d(tx, ty, tz)).norm(), 1e-9);
    EXPECT_LT((frame.T_WC.linear() - Eigen::Quaterniond(qw, qx, qy, qz).matrix()).norm(), 1e-8);
  }
  std::string more;
  EXPECT_FALSE(std::getline(rgb, more));
}

TEST(IndependentReaders, Klg) {
  const TempFolder folder;
  BoxSource source;
  Export(source, DatasetFormat::kKlg, folder / "out");
  std::ifstream in(folder / "out/sequence.klg", std::ios::binary);
  const auto take = [&](auto value) {
    in.read(reinterpret_cast<char*>(&value), sizeof(value));
    return value;
  };
  ASSERT_EQ(take(std::int32_t{}), source.info().frame_count);
  for (int i = 0; i < source.info().frame_count; ++i) {
    const Frame frame = source.Read(i).value();
    EXPECT_NEAR(static_cast<double>(take(std::int64_t{})), 1e6 * i / 30, 0.5001);
    const auto depth_bytes = take(std::int32_t{});
    const auto colour_bytes = take(std::int32_t{});
    std::vector<unsigned char> packed(static_cast<std::size_t>(depth_bytes));
    in.read(reinterpret_cast<char*>(packed.data()), depth_bytes);
    cv::Mat units(48, 64, CV_16UC1);
    uLongf size = 64 * 48 * 2;
    ASSERT_EQ(uncompress(units.data, &size, packed.data(), packed.size()), Z_OK);
    ASSERT_EQ(size, 64U * 48 * 2);
    ExpectDepth(units, 1000, frame);
    ASSERT_EQ(colour_bytes, 64 * 48 * 3) << "raw";
    cv::Mat rgb(48, 64, CV_8UC3);
    in.read(reinterpret_cast<char*>(rgb.data), colour_bytes);
    EXPECT_EQ(cv::norm(rgb, frame.colour, cv::NORM_INF), 0);
  }
  EXPECT_EQ(in.peek(), std::ifstream::traits_type::eof());
}

TEST(IndependentReaders, SevenScenes) {
  const TempFolder folder;
  BoxSource source;
  Export(source, DatasetFormat::kSevenScenes, folder / "out");
  for (int i = 0; i < source.info().frame_count; ++i) {
    const Frame frame = source.Read(i).value();
    const std::string stem = (folder / fmt::format("out/frame-{:06d}", i)).string();
    ExpectColour(cv::imread(stem + ".color.png"), frame);
    ExpectDepth(cv::imread(stem + ".depth.png", cv::IMREAD_UNCHANGED), 1000, frame);
    std::ifstream in(stem + ".pose.txt");
    for (int entry = 0; entry < 16; ++entry) {
      double number = -9;
      in >> number;
      EXPECT_EQ(number, frame.T_WC.matrix()(entry / 4, entry % 4));
    }
  }
}

}  // namespace
}  // namespace tsdfpp
