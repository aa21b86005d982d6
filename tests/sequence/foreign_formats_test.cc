// What readers make of layouts that we do not write, and of what others do differently.
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/files.h"
#include "core/folders.h"
#include "sequence/export.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"
#include "tests/sequence/other_sets.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::BoxSource;
using test::NotesSay;
using test::TempFolder;

// Half a unit and a float's rounding.
void ExpectBoxDepth(const Frame& was, const Frame& is, double units_per_m) {
  EXPECT_LE(cv::norm(was.depth, is.depth, cv::NORM_INF), 0.5 / units_per_m + 2e-7);
}

// The mean difference of a channel, grey levels. OpenCV's JPEG of quality 95 is off by 2 to 3 here;
// red and blue swapped would be off by 50.
void ExpectJpegOf(const cv::Mat& was, const cv::Mat& is) {
  constexpr double kJpegBound = 5;
  EXPECT_LT(cv::norm(was, is, cv::NORM_L1) / static_cast<double>(3 * was.total()), kJpegBound);
}

TEST(ForeignFormats, Replica) {
  const TempFolder folder;
  BoxSource source;
  for (const bool beside : {false, true}) {
    const fs::path set = folder / (beside ? "up/office0" : "office0");
    test::WriteReplica(source, set, beside);
    const auto read = OpenSequence(set);
    ASSERT_TRUE(read.has_value()) << read.error().message;
    EXPECT_EQ((*read)->info().name, "office0");
    EXPECT_EQ((*read)->info().intrinsics, source.info().intrinsics);
    for (int i = 0; i < 6; ++i) {
      const Frame was = source.Read(i).value();
      const Frame is = (*read)->Read(i).value();
      ExpectBoxDepth(was, is, 6553.5);
      EXPECT_LT((was.T_WC.matrix() - is.T_WC.matrix()).norm(), 1e-12);
      EXPECT_EQ(is.time_s, i / 30.0);
      EXPECT_TRUE(is.mask.empty());
      ExpectJpegOf(was.colour, is.colour);
    }
  }
}

TEST(ForeignFormats, Scannet) {
  const TempFolder folder;
  BoxSource source;
  test::WriteScannet(source, folder / "scene0000_00");
  SequenceNotes notes;
  const auto read = OpenSequence(folder / "scene0000_00", {}, &notes);
  ASSERT_TRUE(read.has_value()) << read.error().message;
  const SequenceInfo& info = (*read)->info();
  EXPECT_EQ(info.frame_count, 5) << "the frame without a pose is left out";
  EXPECT_FALSE(info.has_object_poses);
  EXPECT_EQ(info.first_index, 0);
  EXPECT_EQ(info.objects.size(), 3U);
  EXPECT_TRUE(NotesSay(notes, "1 of 6 frames have infinite poses"));
  EXPECT_TRUE(NotesSay(notes, "frame numbers 0 to 50 have gaps"));
  const int numbers[] = {0, 1, 3, 4, 5};
  for (int i = 0; i < 5; ++i) {
    const Frame was = source.Read(numbers[i]).value();
    const Frame is = (*read)->Read(i).value();
    ExpectBoxDepth(was, is, 1000);
    EXPECT_EQ(is.time_s, 10 * numbers[i] / 30.0) << "by the file's number";
    // Four equal pixels each, sampled in their middle.
    EXPECT_EQ(cv::norm(was.mask, is.mask, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(was.colour, is.colour, cv::NORM_INF), 0);
    EXPECT_LT((was.T_WC.matrix() - is.T_WC.matrix()).norm(), 1e-12);
  }
}

// As associations list them, frames may go back in time.
TEST(ForeignFormats, TumFramesAreInTheOrderOfTime) {
  const TempFolder folder;
  BoxSource source(4);
  const fs::path set = folder / "desk";
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, set).has_value());
  std::string turned;
  std::ifstream read(set / "associations.txt");
  for (std::string line; std::getline(read, line);) turned.insert(0, line += '\n');
  ASSERT_TRUE(WriteFile(set / "associations.txt", turned));
  SequenceNotes notes;
  const auto sequence = OpenSequence(set, {}, &notes).value();
  EXPECT_TRUE(NotesSay(notes, "not in the order of the depth images' times"));
  for (int i = 0; i < 4; ++i) {
    const Frame was = source.Read(i).value();
    const Frame is = sequence->Read(i).value();
    EXPECT_NEAR(is.time_s, i / 30.0, 1e-6);
    EXPECT_EQ(cv::norm(was.mask, is.mask, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(was.colour, is.colour, cv::NORM_INF), 0);
  }
}

// Lists without associations: the nearest depth image in time, each taken once; poses in between.
TEST(ForeignFormats, TumAssociatesAndInterpolates) {
  const TempFolder folder;
  BoxSource source(4);
  const fs::path set = folder / "desk";
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, set).has_value());
  fs::remove(set / "associations.txt");
  fs::remove_all(set / "mask");
  const auto file = [](const char* kind, int i) {
    return fmt::format("{}/{:.6f}.png", kind, i / 30.0);
  };
  // Colour 0 is 15 ms before depth 0 and 18 ms after depth 1; 2 is 5 ms from 2; 3 has none.
  std::ofstream(set / "rgb.txt") << "# c\n100.000 " << file("rgb", 0) << "\n100.100 "
                                 << file("rgb", 2) << "\n100.200 " << file("rgb", 3) << "\n";
  std::ofstream(set / "depth.txt")
      << "100.015 " << file("depth", 0) << "\n99.982 " << file("depth", 1) << "\n100.105 "
      << file("depth", 2) << "\n100.221 " << file("depth", 3) << "\n";
  std::ofstream(set / "groundtruth.txt") << "100.005 0 0 0 0 0 0 1\n"
                                            "100.025 0.2 0 0 0 0 0.1736481777 0.9848077530\n"
                                            "100.110 1 1 1 0 0 0 1\n"
                                            "100.400 2 2 2 0 0 0 1\n";
  SequenceOptions options;
  options.check = false;
  SequenceNotes notes;
  const auto read = OpenSequence(set, options, &notes).value();
  ASSERT_EQ(read->info().frame_count, 2);
  EXPECT_TRUE(NotesSay(notes, "1 of 3 colour images have no depth image within 0.02 s"));
  const Frame first = read->Read(0).value();
  EXPECT_LT(cv::norm(first.depth, source.Read(0)->depth, cv::NORM_INF), 0.0002);
  // In the middle between two poses: 10 degrees of 20.
  EXPECT_LT((first.T_WC.translation() - Eigen::Vector3d(0.1, 0, 0)).norm(), 1e-9);
  EXPECT_NEAR(Eigen::AngleAxisd(first.T_WC.linear()).angle(), 10 * M_PI / 180, 1e-6);
  const Frame second = read->Read(1).value();
  EXPECT_NEAR(second.time_s, 0.09, 1e-9);
  EXPECT_LT(cv::norm(second.depth, source.Read(2)->depth, cv::NORM_INF), 0.0002);
  EXPECT_NEAR(second.T_WC.translation().x(), 0.2 + 0.8 * 80 / 85, 1e-6);
}

// Three cups of one obj_id in lists whose order changes, one cup missing at times; one plate.
TEST(ForeignFormats, BopInstancesKeepTheirIds) {
  const TempFolder folder;
  const fs::path scene = folder / "scene/test/000002";
  ASSERT_TRUE(ExportSequence(*std::make_unique<BoxSource>(4), DatasetFormat::kBop, folder / "scene")
                  .has_value());
  fs::rename(folder / "scene/test/000000", scene);
  fs::remove_all(scene / "mask");
  fs::remove_all(scene / "mask_visib");
  nlohmann::json truth;
  const auto object = [](int obj_id, double x_mm) {
    return nlohmann::json{{"obj_id", obj_id},
                          {"cam_R_m2c", {1, 0, 0, 0, 1, 0, 0, 0, 1}},
                          {"cam_t_m2c", {x_mm, 0, 1000}}};
  };
  truth["0"] = {object(5, 0), object(2, 50), object(5, 100), object(5, 200)};
  truth["1"] = {object(5, 205), object(5, 103), object(5, 4), object(2, 50)};
  truth["2"] = {object(5, 108), object(2, 50)};
  truth["3"] = {object(2, 50), object(5, 111), object(5, 207), object(5, 1)};
  std::ofstream(scene / "scene_gt.json") << truth;
  // The camera stands still, so that places in the camera are places in the world.
  nlohmann::json cameras = nlohmann::json::parse(std::ifstream(scene / "scene_camera.json"));
  for (auto& [key, camera] : cameras.items()) {
    camera["cam_R_w2c"] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    camera["cam_t_w2c"] = {0, 0, 0};
    int place = 0;
    for (const auto& entry : truth[key]) {
      cv::Mat mask = cv::Mat::zeros(48, 64, CV_8UC1);
      // A stripe each, where the object is: 0, 50, 100, 200 mm.
      const int row = static_cast<int>(entry["cam_t_m2c"][0].get<double>() / 10);
      mask.row(row).setTo(255);
      fs::create_directories(scene / "mask_visib");
      cv::imwrite(
          (scene / fmt::format("mask_visib/{:06d}_{:06d}.png", std::stoi(key), place++)).string(),
          mask);
    }
  }
  std::ofstream(scene / "scene_camera.json") << cameras;
  SequenceOptions options;
  options.check = false;
  for (const fs::path& path : {scene, folder / "scene"}) {
    const auto read = OpenSequence(path, options).value();
    const SequenceInfo& info = read->info();
    // The plate, the first cup, and after all obj_ids the others.
    ASSERT_EQ(info.objects.size(), 5U);
    EXPECT_TRUE(info.has_object_poses);
    EXPECT_EQ(info.objects[1].id, 2);
    EXPECT_EQ(info.objects[2], (ObjectInfo{5, "obj_000005", "obj_000005"}));
    EXPECT_EQ(info.objects[3], (ObjectInfo{6, "obj_000005_2", "obj_000005"}));
    EXPECT_EQ(info.objects[4], (ObjectInfo{7, "obj_000005_3", "obj_000005"}));
    const std::map<InstanceId, double> x_mm[] = {{{5, 0}, {2, 50}, {6, 100}, {7, 200}},
                                                 {{5, 4}, {2, 50}, {6, 103}, {7, 205}},
                                                 {{2, 50}, {6, 108}},
                                                 {{5, 1}, {2, 50}, {6, 111}, {7, 207}}};
    for (int i = 0; i < 4; ++i) {
      const Frame frame = read->Read(i).value();
      ASSERT_EQ(frame.T_WO.size(), x_mm[i].size()) << i;
      for (const auto& [id, x] : x_mm[i]) {
        EXPECT_NEAR(frame.T_WO.at(id).translation().x(), x / 1000, 1e-12) << i << " " << id;
        EXPECT_EQ(frame.mask.at<InstanceId>(static_cast<int>(x / 10), 30), id);
      }
    }
  }
}

TEST(ForeignFormats, BopWithoutVisibleMasksPaintsTheNearerInFront) {
  const TempFolder folder;
  BoxSource source;
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kBop, folder / "s").has_value());
  fs::remove_all(folder / "s/test/000000/mask_visib");
  SequenceNotes notes;
  const auto read = OpenSequence(folder / "s", {}, &notes).value();
  EXPECT_TRUE(NotesSay(notes, "no mask_visib/"));
  // The right box is the nearer one everywhere, so this is the truth but for edge pixels that a ray
  // grazes.
  for (int i = 0; i < 6; ++i) {
    EXPECT_LE(cv::countNonZero(read->Read(i)->mask != source.Read(i)->mask), 2) << i;
  }
}

TEST(ForeignFormats, SevenScenesRotationsAreMadeOrthonormal) {
  const TempFolder folder;
  BoxSource source(3);
  const fs::path set = folder / "chess";
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kSevenScenes, set).has_value());
  Eigen::Matrix4d T = source.Read(1)->T_WC.matrix();
  T(0, 0) += 2e-4;
  T(1, 2) -= 2e-4;
  std::ofstream pose(set / "frame-000001.pose.txt");
  pose.precision(17);
  pose << T << '\n';
  pose.close();
  // Any subset of frame numbers.
  fs::rename(set / "frame-000002.color.png", set / "frame-000900.color.png");
  fs::rename(set / "frame-000002.depth.png", set / "frame-000900.depth.png");
  fs::rename(set / "frame-000002.pose.txt", set / "frame-000900.pose.txt");
  fs::rename(set / "frame-000002.mask.png", set / "frame-000900.mask.png");
  // 65535 is no depth.
  cv::Mat depth = cv::imread((set / "frame-000001.depth.png").string(), cv::IMREAD_UNCHANGED);
  depth.at<std::uint16_t>(7, 9) = 65535;
  cv::imwrite((set / "frame-000001.depth.png").string(), depth);
  const auto read = OpenSequence(set).value();
  EXPECT_EQ(read->info().frame_count, 3);
  const Frame frame = read->Read(1).value();
  const Eigen::Matrix3d R = frame.T_WC.linear();
  EXPECT_LT((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_LT((R - source.Read(1)->T_WC.linear()).norm(), 4e-4);
  EXPECT_EQ(frame.depth.at<float>(7, 9), 0.0F);
  EXPECT_EQ(read->Read(2)->time_s, 900 / 30.0);
}

TEST(ForeignFormats, KlgTakesRawDepthAndJpegColour) {
  const TempFolder folder;
  BoxSource source(2);
  std::ofstream out(folder / "r.klg", std::ios::binary);
  const auto put = [&](auto value) {
    out.write(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  put(std::int32_t{2});
  for (int i = 0; i < 2; ++i) {
    const Frame frame = source.Read(i).value();
    cv::Mat mm;
    frame.depth.convertTo(mm, CV_16U, 1000);
    // As Logger2 does it: red is first, where the encoder takes the first for blue.
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", frame.colour, jpeg);
    put(std::int64_t{1000000000 + 33333 * i});
    put(static_cast<std::int32_t>(mm.total() * 2));
    put(static_cast<std::int32_t>(jpeg.size()));
    out.write(reinterpret_cast<const char*>(mm.data), static_cast<std::streamsize>(mm.total() * 2));
    out.write(reinterpret_cast<const char*>(jpeg.data()),
              static_cast<std::streamsize>(jpeg.size()));
  }
  out << "tail";
  out.close();
  SequenceOptions options;
  options.intrinsics = source.info().intrinsics;
  options.fixed_camera = true;
  SequenceNotes notes;
  const auto read = OpenSequence(folder / "r.klg", options, &notes).value();
  EXPECT_TRUE(NotesSay(notes, "4 bytes follow the last of its 2 frames"));
  for (int i = 0; i < 2; ++i) {
    const Frame frame = read->Read(i).value();
    ExpectBoxDepth(source.Read(i).value(), frame, 1000);
    EXPECT_EQ(frame.T_WC.matrix(), Eigen::Matrix4d::Identity());
    EXPECT_NEAR(frame.time_s, 0.033333 * i, 1e-9);
    ExpectJpegOf(source.Read(i)->colour, frame.colour);
  }
}

TEST(ForeignFormats, MasksThatAreNotReadAreSaid) {
  const TempFolder folder;
  BoxSource source;
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, folder / "t").has_value());
  fs::rename(folder / "t/mask", folder / "t/instance_seg");
  SequenceNotes notes;
  const auto read = OpenSequence(folder / "t", {}, &notes).value();
  EXPECT_TRUE(read->Read(0)->mask.empty());
  EXPECT_TRUE(NotesSay(notes, "instance_seg: looks like masks and is not read"));
  EXPECT_TRUE(NotesSay(notes, "t: no masks"));
}

// The faults of units and poses where there is no real data (real_data_test.cc) to show them.
TEST(ForeignFormats, WrongUnitsAndPosesAreNamed) {
  const auto what_is_said = [](const std::function<Pose(const Pose&)>& change,
                               const SequenceOptions& options = {}) {
    const TempFolder folder;
    BoxSource source(8);
    EXPECT_TRUE(ExportSequence(source, DatasetFormat::kSevenScenes, folder / "set").has_value());
    for (int i = 0; i < 8; ++i) {
      std::ofstream out(folder / fmt::format("set/frame-{:06d}.pose.txt", i));
      out.precision(17);
      out << change(source.Read(i)->T_WC).matrix() << '\n';
    }
    const auto read = OpenSequence(folder / "set", options);
    return read ? std::string() : read.error().message;
  };
  const auto same = [](const Pose& T) { return T; };
  const auto inverted = [](const Pose& T) { return T.inverse(); };
  EXPECT_EQ(what_is_said(same), "");
  EXPECT_NE(what_is_said(inverted).find("the camera poses look inverted"), std::string::npos)
      << what_is_said(inverted);
  const auto millimetres = [](Pose T) {
    T.translation() *= 1000;
    return T;
  };
  EXPECT_NE(what_is_said(millimetres).find("positions look like millimetres"), std::string::npos);
  SequenceOptions options;
  options.depth_units_per_m = 10000;
  EXPECT_NE(what_is_said(same, options).find("depth looks like 1000 units a metre"),
            std::string::npos)
      << what_is_said(same, options);
  options.depth_units_per_m.reset();
  options.check = false;
  EXPECT_EQ(what_is_said(inverted, options), "");
}

TEST(ForeignFormats, SeveralFormatsNeedAWord) {
  const TempFolder folder;
  BoxSource source;
  const fs::path set = folder / "t";
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, set).has_value());
  test::WriteReplica(source, set);
  const auto unclear = OpenSequence(set);
  ASSERT_FALSE(unclear.has_value());
  EXPECT_EQ(unclear.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(unclear.error().message,
            set.string() + ": several formats fit (tum, replica), expected --dataset to say which");
  SequenceOptions options;
  options.format = DatasetFormat::kReplica;
  EXPECT_TRUE(OpenSequence(set, options).value()->Read(0)->mask.empty());
  options.format = DatasetFormat::kTum;
  EXPECT_FALSE(OpenSequence(set, options).value()->Read(0)->mask.empty());
}

TEST(ForeignFormats, NamesOfFormats) {
  for (const DatasetFormat format : AllDatasetFormats()) {
    EXPECT_EQ(DatasetFormatFromName(DatasetFormatName(format)).value(), format);
  }
  const auto unknown = DatasetFormatFromName("kitti");
  ASSERT_FALSE(unknown.has_value());
  EXPECT_EQ(unknown.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(unknown.error().message,
            "format 'kitti' is not known, expected one of cofusion, tum, bop, klg, scannet, "
            "replica, 7scenes");
}

TEST(ForeignFormats, ThePageHasThemAll) {
  const std::string page = ReadFile(TSDFPP_SOURCE_DIR "/docs/datasets.md").value();
  std::string choice;
  for (const DatasetFormat format : AllDatasetFormats()) {
    const std::string name = DatasetFormatName(format);
    EXPECT_NE(page.find("\n| `" + name + "` | "), std::string::npos) << "no row of " << name;
    choice += (choice.empty() ? "" : "|") + name;
  }
  EXPECT_NE(page.find("`--dataset " + choice + "`"), std::string::npos) << "at its top";
}

TEST(ForeignFormats, TheSourcesNameEveryReader) {
  const fs::path root = TSDFPP_SOURCE_DIR;
  const std::string page = ReadFile(root / "docs" / "sources.md").value();
  int readers = 0;
  for (const fs::path& file : EntriesOf(root / "sequence")) {
    const std::string name = file.filename().string();
    if (!name.ends_with("_reader.cc")) continue;
    EXPECT_NE(page.find("`sequence/" + name + "`"), std::string::npos)
        << "docs/sources.md does not say where the layout of sequence/" << name << " is from";
    ++readers;
  }
  EXPECT_GT(readers, 0);
}

}  // namespace
}  // namespace tsdfpp
