// Every sentence of the reader, with its kind.
#include <gtest/gtest.h>

#include <functional>

#include "sequence/cofusion_writer.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/foreign_set.h"
#include "tests/sequence/memory_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::TempFolder;
using test::WriteImage;

// What opening and then reading frame 1 and the truth of a set says, with '@' for its folder.
std::string FirstSentence(const fs::path& set) {
  const auto strip = [&](const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::kData);
    std::string message = error.message;
    const std::string folder = set.string();
    for (std::size_t at = 0; (at = message.find(folder)) != std::string::npos;) {
      message = fmt::format("{}@{}", message.substr(0, at), message.substr(at + folder.size()));
    }
    return message;
  };
  const auto source = OpenSequence(set);
  if (!source) return strip(source.error());
  const auto frame = (*source)->Read(1);
  if (!frame) return strip(frame.error());
  const auto truth = (*source)->Truth();
  return truth ? "" : strip(truth.error());
}

struct Case {
  std::function<void(const fs::path&)> spoil;
  std::string sentence;
};

auto Text(const std::string& file, const std::string& text) {
  return [=](const fs::path& set) { ASSERT_TRUE(WriteFile(set / file, text).has_value()); };
}
auto Image(const std::string& file, const cv::Mat& image) {
  return [=](const fs::path& set) { WriteImage(set / file, image); };
}
auto Remove(const std::string& file) {
  return [=](const fs::path& set) { ASSERT_GT(fs::remove_all(set / file), 0U) << file; };
}
// The first half of the file is left.
auto Cut(const std::string& file) {
  return [=](const fs::path& set) { fs::resize_file(set / file, fs::file_size(set / file) / 2); };
}

// A one-channel EXR file with some of its header's bytes changed.
auto ChangedInFile(const std::string& file, const std::string& from, const std::string& to) {
  return [=](const fs::path& set) {
    WriteImage(set / file, cv::Mat(6, 8, CV_32FC1, cv::Scalar(1)));
    const std::string bytes = ReadFile(set / file).value();
    const std::size_t at = bytes.find(from);
    ASSERT_NE(at, std::string::npos);
    const std::string changed = bytes.substr(0, at) + to + bytes.substr(at + from.size());
    ASSERT_TRUE(WriteFile(set / file, changed).has_value());
  };
}

const char* const kNoFormat =
    "@: not a sequence; expected calibration.txt and colour/ (cofusion), rgb.txt and depth.txt "
    "(tum), scene_camera.json (bop), a .klg (klg), color/, depth/ and pose/ (scannet), traj.txt "
    "and results/ (replica), or frame-*.depth.png (7scenes)";

TEST(CofusionErrors, ForeignSet) {
  const cv::Mat small_colour(6, 7, CV_8UC3, cv::Scalar::all(1));
  const cv::Mat large_depth(12, 16, CV_32FC1, cv::Scalar(1));
  cv::Mat two_depths(6, 8, CV_32FC3, cv::Scalar::all(1));
  two_depths.at<cv::Vec3f>(4, 4)[1] = 2;
  const cv::Mat coloured_mask(6, 8, CV_8UC3, cv::Scalar(1, 2, 3));
  const std::string calibration = "expected fx fy cx cy [width height]";
  const Case cases[] = {
      // The folder.
      {Remove("calibration.txt"), kNoFormat},
      {Remove("colour"), kNoFormat},
      // The calibration.
      {Text("calibration.txt", "360 360 4"), "@/calibration.txt: 3 numbers, " + calibration},
      {Text("calibration.txt", "360 360 4 3 8"), "@/calibration.txt: 5 numbers, " + calibration},
      {Text("calibration.txt", "360 f 4 3"),
       "@/calibration.txt: number 2 cannot be read, " + calibration},
      {Text("calibration.txt", "360 360 4 nan"),
       "@/calibration.txt: number 4 cannot be read, " + calibration},
      {Text("calibration.txt", "360 -360 4 3"),
       "@/calibration.txt: focal lengths 360 and -360, expected both over 0"},
      {Text("calibration.txt", "360 360 4 3 8.5 6"),
       "@/calibration.txt: image size 8.5 x 6, expected whole numbers from 1 to 16384"},
      {Text("calibration.txt", "360 360 320 240 640 480"),
       "@/colour/Color0001.png: the image is 8x6, expected 640x480 (calibration.txt)"},
      {Text("calibration.txt", "360 360 4 3"),
       "@/calibration.txt: focal lengths 360 and 360 do not fit an image 8 pixels wide, expected "
       "1.6 to 80"},
      {Text("calibration.txt", "9 9 8 6"),
       "@/calibration.txt: the principal point (8, 6) is far from the middle of the 8x6 image: "
       "intrinsics of another resolution"},
      // Colour.
      {Remove("colour/Color0001.png"),
       "@/colour/Color0001.png: no such image, though there are others up to number 2"},
      {[](const fs::path& set) {
         for (const char* file : {"Color0000.png", "Color0001.png"})
           fs::remove(set / "colour" / file);
       },
       "@/colour: the first image has number 2, expected 0 or 1"},
      {[](const fs::path& set) {
         fs::remove_all(set / "colour");
         fs::create_directories(set / "colour");
       },
       "@/colour: no image named Color0001.png or so"},
      {Image("colour/Color0001.png", small_colour),
       "@/colour/Color0001.png: the image is 7x6, expected 8x6 (calibration.txt)"},
      {Text("colour/Color0001.png", "not a PNG"),
       "@/colour/Color0001.png: cannot be decoded as an image"},
      {Text("colour/Color0001.png", ""), "@/colour/Color0001.png: cannot be decoded as an image"},
      {Cut("colour/Color0001.png"), "@/colour/Color0001.png: cannot be decoded as an image"},
      {Image("colour/Color0001.png", cv::Mat(6, 8, CV_16UC3, cv::Scalar::all(1))),
       "@/colour/Color0001.png: the image is 16-bit unsigned with 3 channels, expected 8-bit RGB"},
      {Image("colour/Color0001.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar::all(1))),
       "@/colour/Color0001.png: the image is 8-bit unsigned with 1 channel, expected 8-bit RGB"},
      // Depth.
      {Remove("depth_original/Depth0001.exr"), "@/depth_original/Depth0001.exr: no such image"},
      {Remove("depth_original"), "@/depth_original/Depth0001.exr: no such image"},
      {Cut("depth_original/Depth0001.exr"),
       "@/depth_original/Depth0001.exr: cannot be decoded as an image"},
      {Image("depth_original/Depth0001.exr", large_depth),
       "@/depth_original/Depth0001.exr: the image is 16x12, expected 8x6 (calibration.txt)"},
      {[](const fs::path& set) {
         fs::remove(set / "depth_original/Depth0001.exr");
         WriteImage(set / "depth_original/Depth0001.png",
                    cv::Mat(6, 8, CV_16UC1, cv::Scalar(1500)));
       },
       "@/depth_original/Depth0001.png: depth of an integer type, expected Depth0001.exr in 32-bit "
       "float metres"},
      {[](const fs::path& set) {
         WriteImage(set / "sixteen.png", cv::Mat(6, 8, CV_16UC1, cv::Scalar(1500)));
         fs::rename(set / "sixteen.png", set / "depth_original/Depth0001.exr");
       },
       "@/depth_original/Depth0001.exr: depth is 16-bit unsigned with 1 channel, expected 32-bit "
       "float metres"},
      {Image("depth_original/Depth0001.exr", two_depths),
       "@/depth_original/Depth0001.exr: depth has 3 channels that differ, expected one or three "
       "equal ones"},
      {Image("depth_original/Depth0001.exr", cv::Mat(6, 8, CV_32FC1, cv::Scalar(1500))),
       "@/depth_original/Depth0001.exr: the median depth is 1500, which looks like millimetres, "
       "expected metres"},
      // OpenCV would read this as floats.
      {ChangedInFile("depth_original/Depth0001.exr", std::string("Y\0\2", 3),
                     std::string("Y\0\0", 3)),
       "@/depth_original/Depth0001.exr: depth of an integer type (channel Y), expected 32-bit "
       "float metres"},
      // And this as zeros.
      {ChangedInFile("depth_original/Depth0001.exr", std::string("Y\0\2", 3),
                     std::string("Z\0\2", 3)),
       "@/depth_original/Depth0001.exr: depth in channels Z, expected Y, or R, G and B"},
      // Masks.
      {Remove("mask_id/Mask0001.png"), "@/mask_id/Mask0001.png: no such image"},
      {Cut("mask_id/Mask0001.png"), "@/mask_id/Mask0001.png: cannot be decoded as an image"},
      {Image("mask_id/Mask0001.png", small_colour),
       "@/mask_id/Mask0001.png: the image is 7x6, expected 8x6 (calibration.txt)"},
      {Image("mask_id/Mask0001.png", coloured_mask),
       "@/mask_id/Mask0001.png: the mask is coloured, expected ids as 8-bit grey or as RGB with "
       "equal channels"},
      {Image("mask_id/Mask0001.png", cv::Mat(6, 8, CV_16UC1, cv::Scalar(1))),
       "@/mask_id/Mask0001.png: the mask is 16-bit unsigned with 1 channel, expected 8-bit grey "
       "ids"},
      // Trajectories.
      {Remove("trajectories"), "@/trajectories/gt-cam-0.txt: no such file"},
      {Text("trajectories/gt-cam-0.txt", "0 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n"),
       "@/trajectories/gt-cam-0.txt: no camera pose for frame 1"},
      {Text("trajectories/gt-cam-0.txt", "0 0 0 0\n"),
       "@/trajectories/gt-cam-0.txt:1: '0 0 0' is not a pose: expected seven numbers tx ty tz qx "
       "qy qz qw"},
      {Text("trajectories/gt-boat.txt", ""),
       "@/trajectories/gt-boat.txt: the file's name does not end with an object's id, expected "
       "gt-<name>-<id>.txt"},
      {Text("trajectories/gt-truck-1.txt", ""),
       "@/trajectories/gt-truck-1.txt: a second trajectory of object 1"},
      // Models.
      {[](const fs::path&) {},
       "@/models: no true surfaces here (<name>-<id>.ply); the sequence can be mapped but not "
       "compared with truth"},
      {Text("models/boat-9.ply", ""),
       "@/models/boat-9.ply: a model of object 9, which the sequence does not have"},
      {Text("models/ship-1.ply", "plx\n"),
       "@/models/ship-1.ply: not a PLY file: it does not begin with 'ply'"},
  };
  for (const Case& test_case : cases) {
    const TempFolder folder;
    const fs::path set = folder / "set";
    test::WriteForeignSet(set);
    test_case.spoil(set);
    EXPECT_EQ(FirstSentence(set), test_case.sentence);
  }
}

// A calibration of four numbers says nothing of the size, and sequence.json agrees.
void TakeSizeAway(const fs::path& set) {
  const std::string camera = ReadFile(set / "calibration.txt").value();
  ASSERT_TRUE(WriteFile(set / "calibration.txt", camera.substr(0, camera.rfind(" 13 7"))));
  std::string json = ReadFile(set / "sequence.json").value();
  for (const std::string side : {"\"width\": 13", "\"height\": 7"}) {
    const std::size_t at = json.find(side);
    ASSERT_NE(at, std::string::npos) << json;
    json.replace(at, side.size(), side.substr(0, side.find(' ')) + " 0");
  }
  ASSERT_TRUE(WriteFile(set / "sequence.json", json).has_value());
}

// A set with one more file, which is listed.
auto Listed(const std::string& file, const std::string& text) {
  return [=](const fs::path& set) {
    ASSERT_TRUE(WriteFile(set / file, text).has_value());
    auto record = ReadSequenceJson(set / "sequence.json");
    ASSERT_TRUE(record.has_value());
    record->hashes[file] = HashText(text);
    ASSERT_TRUE(WriteFile(set / "sequence.json", SequenceToJson(*record)).has_value());
  };
}

// Whose sensor says where it thinks that the camera is.
auto SensedCamera(const std::string& text) { return Listed("trajectories/sensed-cam-0.txt", text); }

TEST(CofusionErrors, OurOwnSet) {
  // The truth never stands in for what was sensed.
  const std::string no_sensed = "@/trajectories/sensed-cam-0.txt: no camera pose for frame 1";
  const Case cases[] = {
      {[](const fs::path&) {}, ""},
      {Text("sequence.json", "{"), "@/sequence.json: not a JSON object"},
      {Text("calibration.txt", "564.3 1 6 3 13 7"),
       "@/sequence.json: the intrinsics differ from those in calibration.txt"},
      {TakeSizeAway,
       "@/sequence.json: a field is missing or of another type (width is 0, expected a whole "
       "number "
       "from 2 to 16384)"},
      {Text("trajectories/gt-boat-9.txt", ""),
       "@/trajectories/gt-boat-9.txt: object 9 is not listed in sequence.json"},
      {SensedCamera("1 0 0 0 0 0 0 1\n"), ""},
      {SensedCamera("2 0 0 0 0 0 0 1\n"), no_sensed},
      {SensedCamera(""), no_sensed},
      {Listed("mask_noise/Mask0002.png", ""), "@/mask_noise/Mask0001.png: no such image"},
      {Listed("mask_noise/segments.csv", ""), ""},
      {Remove("colour/Color0001.png"), "@/colour/Color0001.png: no such image"},
      {Remove("mask_id"), "@/mask_id/Mask0001.png: no such image"},
      {Remove("models/car-2.ply"),
       "@/models/car-2.ply: no such model, though sequence.json lists it"},
  };
  for (const Case& test_case : cases) {
    const TempFolder folder;
    const fs::path set = folder / "set";
    test::MemorySource source;
    ASSERT_TRUE(WriteCofusion(source, test::SomeGenerator(), set).has_value());
    test_case.spoil(set);
    EXPECT_EQ(FirstSentence(set), test_case.sentence);
  }
}

TEST(CofusionErrors, FrameOutOfRangeIsTheUsersFault) {
  const TempFolder folder;
  test::WriteForeignSet(folder / "room");
  const auto source = OpenSequence(folder / "room").value();
  for (const int index : {-1, 3}) {
    const auto frame = source->Read(index);
    ASSERT_FALSE(frame.has_value());
    EXPECT_EQ(frame.error().kind, ErrorKind::kUsage);
    EXPECT_EQ(frame.error().message,
              fmt::format("frame {} is out of range, room has frames 0 to 2", index));
  }
}

TEST(CofusionErrors, MissingFolderIsTheUsersFault) {
  const TempFolder folder;
  const auto missing = OpenSequence(folder / "none");
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(missing.error().message, (folder / "none").string() + ": no such folder");
  ASSERT_TRUE(WriteFile(folder / "file", "").has_value());
  const auto file = OpenSequence(folder / "file");
  ASSERT_FALSE(file.has_value());
  EXPECT_EQ(file.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(file.error().message, (folder / "file").string() +
                                      ": is a file, expected the folder of a sequence or a .klg");
}

}  // namespace
}  // namespace tsdfpp
