// What is exported and opened again: exact where the format allows, else within stated bounds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "sequence/export.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/memory_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::MemorySource;
using test::TempFolder;

// Noise with a camera that could exist.
MemorySource Noise(int first = 1) {
  MemorySource source(4, first);
  source.info_.intrinsics = {13, 7, 11.3, 1.0 / 3 + 11, 6.123456789012345, 3.1};
  return source;
}

constexpr double kTimeBound_s = 0.5000001e-6;  // TUM and klg hold microseconds
constexpr double kRotationBound = 1e-12;       // made orthonormal, inverted: a few bits

struct Bounds {
  double units_per_m = 0;
  double time_s = 0;
  double pose_m = 0;  // 0: the same bits
  bool ids_with_poses_only = false;
};

void ExpectDepth(const Frame& was, const Frame& is, double units_per_m) {
  // Half a unit, and float's own rounding of up to 100 m.
  const double bound = 0.5 / units_per_m + 1e-7 * kMaxValidDepth_m;
  for (int y = 0; y < was.depth.rows; ++y) {
    for (int x = 0; x < was.depth.cols; ++x) {
      const float a = was.depth.at<float>(y, x);
      const float b = is.depth.at<float>(y, x);
      const bool fits = IsValidDepth(a) && a <= 65534 / units_per_m && a >= 0.5 / units_per_m;
      if (fits) {
        EXPECT_NEAR(a, b, bound) << x << " " << y;
      } else {
        EXPECT_EQ(b, 0.0F) << x << " " << y;
      }
    }
  }
}

void ExpectPose(const Pose& was, const Pose& is, double bound_m) {
  if (bound_m == 0) {
    EXPECT_EQ(was.matrix(), is.matrix());
    return;
  }
  EXPECT_LT((was.translation() - is.translation()).norm(), bound_m);
  EXPECT_LT((was.linear() - is.linear()).cwiseAbs().maxCoeff(), kRotationBound);
}

void ExpectFrame(const Frame& was, const Frame& is, const Bounds& bounds) {
  EXPECT_EQ(was.intrinsics, is.intrinsics);
  EXPECT_EQ(cv::norm(was.colour, is.colour, cv::NORM_INF), 0);
  ExpectDepth(was, is, bounds.units_per_m);
  ASSERT_EQ(was.mask.size(), is.mask.size());
  for (int y = 0; y < was.mask.rows; ++y) {
    for (int x = 0; x < was.mask.cols; ++x) {
      InstanceId id = was.mask.at<InstanceId>(y, x);
      if (bounds.ids_with_poses_only && !was.T_WO.contains(id)) id = kBackground;
      EXPECT_EQ(is.mask.at<InstanceId>(y, x), id);
    }
  }
  ExpectPose(was.T_WC, is.T_WC, bounds.pose_m);
  EXPECT_NEAR(was.time_s, is.time_s, bounds.time_s);
}

bool Says(const std::vector<std::string>& list, const std::string& words) {
  return std::any_of(list.begin(), list.end(), [&](const std::string& sentence) {
    return sentence.find(words) != std::string::npos;
  });
}

std::unique_ptr<FrameSource> ExportAndOpen(MemorySource& source, DatasetFormat format,
                                           const fs::path& out, ExportReport& report) {
  auto exported = ExportSequence(source, format, out);
  EXPECT_TRUE(exported.has_value()) << exported.error().message;
  if (!exported) return nullptr;
  report = *exported;
  EXPECT_EQ(report.frames, source.info().frame_count);
  EXPECT_EQ(DetectFormats(out), std::vector{format});
  auto opened = OpenSequence(out);
  EXPECT_TRUE(opened.has_value()) << opened.error().message;
  return opened ? std::move(*opened) : nullptr;
}

TEST(ExportRoundTrip, Tum) {
  const TempFolder folder;
  MemorySource source = Noise();
  ExportReport report;
  const auto read = ExportAndOpen(source, DatasetFormat::kTum, folder / "out", report);
  ASSERT_NE(read, nullptr);
  EXPECT_EQ(read->info().intrinsics, source.info().intrinsics);
  EXPECT_NEAR(read->info().rate_hz, source.info().rate_hz, 0.002);  // of times to a microsecond
  EXPECT_EQ(read->info().first_index, 0);
  for (int i = 0; i < 4; ++i) {
    ExpectFrame(source.Read(1 + i).value(), read->Read(i).value(),
                {kTumExportUnits, kTimeBound_s, 0, false});
  }
  EXPECT_EQ(read->info().objects, (std::vector<ObjectInfo>{{0, "background", "background"},
                                                           {1, "object1", ""},
                                                           {2, "object2", ""},
                                                           {7, "object7", ""},
                                                           {255, "object255", ""}}));
  for (const char* words :
       {"names and classes", "poses of objects", "true surfaces", "reveal plan",
        "the first is 0, not 1", "pixels over 13.11 m", "pixels under 0.0001 m"}) {
    EXPECT_TRUE(Says(report.left_out, words)) << words;
  }
  EXPECT_EQ(report.depth_bound_m, 0.0001);
  EXPECT_FALSE(read->Truth().has_value());
}

TEST(ExportRoundTrip, Klg) {
  const TempFolder folder;
  MemorySource source = Noise(0);
  ExportReport report;
  const auto read = ExportAndOpen(source, DatasetFormat::kKlg, folder / "out", report);
  ASSERT_NE(read, nullptr);
  for (int i = 0; i < 4; ++i) {
    ExpectFrame(source.Read(i).value(), read->Read(i).value(),
                {kMillimetreUnits, kTimeBound_s, 0, false});
  }
  // In any order, and the file itself as well as its folder.
  const auto file = OpenSequence(folder / "out/sequence.klg").value();
  for (const int i : {3, 0}) test::ExpectSame(file->Read(i).value(), read->Read(i).value());
  EXPECT_FALSE(Says(report.left_out, "frame numbers"));
}

TEST(ExportRoundTrip, SevenScenes) {
  const TempFolder folder;
  MemorySource source = Noise(17);
  source.info_.rate_hz = 30;
  ExportReport report;
  const auto read = ExportAndOpen(source, DatasetFormat::kSevenScenes, folder / "out", report);
  ASSERT_NE(read, nullptr);
  EXPECT_EQ(read->info().first_index, 17);
  for (int i = 17; i < 21; ++i) {
    ExpectFrame(source.Read(i).value(), read->Read(i).value(),
                {kMillimetreUnits, 1e-12, kMatrixPoseBound_m, false});
  }
  EXPECT_FALSE(Says(report.left_out, "times"));
}

TEST(ExportRoundTrip, Bop) {
  const TempFolder folder;
  MemorySource source = Noise(3);
  ExportReport report;
  const auto read = ExportAndOpen(source, DatasetFormat::kBop, folder / "out", report);
  ASSERT_NE(read, nullptr);
  EXPECT_EQ(read->info().first_index, 3);
  for (int i = 3; i < 7; ++i) {
    const Frame was = source.Read(i).value();
    const Frame is = read->Read(i).value();
    // Times are the 30 Hz that BOP does not know: 1 ms off after 30 frames of 29.97 Hz.
    ExpectFrame(was, is, {kBopExportUnits, 0.001, kMatrixPoseBound_m, true});
    ASSERT_EQ(was.T_WO.size(), is.T_WO.size());
    for (const auto& [id, T_WO] : was.T_WO) ExpectPose(T_WO, is.T_WO.at(id), kMatrixPoseBound_m);
  }
  // Object 7 never has a pose and so is not in scene_gt.json.
  EXPECT_EQ(read->info().objects,
            (std::vector<ObjectInfo>{
                {0, "background", "background"}, {1, "toy-truck", "truck"}, {2, "car", ""}}));
  EXPECT_TRUE(Says(report.left_out, "the mask of object 2 on 1 frames"));
  EXPECT_TRUE(Says(report.left_out, "the mask of object 7 on 4 frames"));
  EXPECT_TRUE(Says(report.left_out, "the mask of object 255 on 4 frames")) << "it is not listed";
  EXPECT_FALSE(Says(report.left_out, "the mask of object 0 "));
  const auto models = read->Truth().value();
  ASSERT_EQ(models.size(), 3U);
  for (std::size_t m = 0; m < 3; ++m) {
    const TrueModel& was = source.models_[m];
    EXPECT_EQ(models[m].mesh_O.triangles, was.mesh_O.triangles);
    EXPECT_EQ(models[m].regions, was.regions);
    EXPECT_EQ(models[m].face_region, was.face_region);
    for (std::size_t v = 0; v < was.mesh_O.vertices.size(); ++v) {
      // Twice float's rounding of a metre.
      EXPECT_LT((models[m].mesh_O.vertices[v] - was.mesh_O.vertices[v]).norm(), 3e-7);
    }
  }
}

// BOP has no pixels that are of no instance.
TEST(ExportRoundTrip, BopSaysWhereNothingIsKnown) {
  const TempFolder folder;
  MemorySource source = Noise(3);
  source.on_read = [](Frame& frame) -> Expected<void> {
    if (frame.index < 5) frame.mask.at<InstanceId>(2, 2) = kNoInstance;
    return {};
  };
  ExportReport report;
  const auto read = ExportAndOpen(source, DatasetFormat::kBop, folder / "out", report);
  ASSERT_NE(read, nullptr);
  EXPECT_EQ(read->Read(3).value().mask.at<InstanceId>(2, 2), kBackground);
  EXPECT_TRUE(Says(report.left_out, "the pixels of no instance (id 65535) on 2 frames"));
  EXPECT_FALSE(Says(report.left_out, "object 65535"));
}

TEST(ExportRoundTrip, WithoutMasksAndTruth) {
  const TempFolder folder;
  for (const DatasetFormat format : {DatasetFormat::kTum, DatasetFormat::kBop, DatasetFormat::kKlg,
                                     DatasetFormat::kSevenScenes}) {
    MemorySource source = Noise();
    source.models_.clear();
    source.on_read = [](Frame& frame) -> Expected<void> {
      frame.mask = cv::Mat();
      frame.T_WO.clear();
      return {};
    };
    ExportReport report;
    const auto read = ExportAndOpen(source, format, folder / DatasetFormatName(format), report);
    ASSERT_NE(read, nullptr);
    const Frame frame = read->Read(read->info().first_index).value();
    EXPECT_TRUE(frame.mask.empty());
    EXPECT_TRUE(frame.T_WO.empty());
    EXPECT_EQ(read->info().objects.size(), 1U);
    EXPECT_FALSE(read->Truth().has_value());
  }
}

// Files are called by their times, also of frames that are not next to one another.
TEST(ExportRoundTrip, TumNeedsTimesThatDiffer) {
  const TempFolder folder;
  MemorySource source = Noise();
  const int first = source.info().first_index;
  source.on_read = [&](Frame& frame) -> Expected<void> {
    frame.time_s = frame.index == first + 2 ? 0 : frame.index - first;
    return {};
  };
  const auto failed = ExportSequence(source, DatasetFormat::kTum, folder / "out");
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().message,
            fmt::format("frame {}: its time is that of frame {}, 0.000000 s, expected another",
                        first + 2, first));
  EXPECT_EQ(folder.Entries(), 0);
}

// A frame that cannot be read, or an `out` that holds something, leaves nothing behind.
TEST(ExportRoundTrip, WholeOrNotAtAll) {
  const TempFolder folder;
  for (const DatasetFormat format : {DatasetFormat::kTum, DatasetFormat::kBop, DatasetFormat::kKlg,
                                     DatasetFormat::kSevenScenes}) {
    MemorySource source = Noise();
    source.on_read = [](Frame& frame) -> Expected<void> {
      if (frame.index == 3) return DataError("frame 3 is lost");
      return {};
    };
    const auto failed = ExportSequence(source, format, folder / "out");
    ASSERT_FALSE(failed.has_value());
    EXPECT_EQ(failed.error().message, "frame 3 is lost");
    EXPECT_EQ(folder.Entries(), 0);
    source.on_read = [](Frame& frame) -> Expected<void> {
      if (frame.index == 3) frame.mask = cv::Mat();
      return {};
    };
    const auto maskless = ExportSequence(source, format, folder / "out");
    ASSERT_FALSE(maskless.has_value());
    EXPECT_EQ(maskless.error().message, "frame 3: expected a mask on every frame or on none");
    EXPECT_EQ(folder.Entries(), 0);
  }
}

TEST(ExportRoundTrip, OutMustBeNewOrEmpty) {
  const TempFolder folder;
  MemorySource source = Noise();
  fs::create_directories(folder / "empty");
  EXPECT_TRUE(ExportSequence(source, DatasetFormat::kTum, folder / "empty/").has_value());
  const auto again = ExportSequence(source, DatasetFormat::kTum, folder / "empty");
  ASSERT_FALSE(again.has_value());
  EXPECT_EQ(again.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(again.error().message, (folder / "empty").string() +
                                       ": the folder holds something other than a sequence of "
                                       "ours, expected a new or an empty folder");
  const auto other = ExportSequence(source, DatasetFormat::kScannet, folder / "new");
  ASSERT_FALSE(other.has_value());
  EXPECT_EQ(other.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(other.error().message,
            "export to scannet is not known, expected tum, bop, klg or 7scenes");
}

}  // namespace
}  // namespace tsdfpp
