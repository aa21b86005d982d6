// Damaged sets of every format but Co-Fusion's (cofusion_errors_test.cc) and BOP's
// (malformed_bop_test.cc): each gives its sentence.
#include "tests/sequence/malformed.h"

#include <sys/stat.h>

#include <fstream>

#include "tests/sequence/other_sets.h"

namespace tsdfpp::test {
namespace {

TEST(Malformed, Tum) {
  const std::string depth = "depth/0.033333.png";
  CheckAll(
      Exported(DatasetFormat::kTum),
      {
          {Remove("groundtruth.txt"), "@/groundtruth.txt: no such file"},
          // As a folder that another user may not read.
          {[](const fs::path& set) {
             fs::remove_all(set / "mask");
             fs::create_symlink("mask", set / "mask");
           },
           "@/mask: cannot be read as a folder (Too many levels of symbolic links)"},
          {Text("groundtruth.txt", "# nothing\n"), "@/groundtruth.txt: holds no poses"},
          {Text("groundtruth.txt", "zero 0 0 0 0 0 0 1\n"),
           "@/groundtruth.txt:1: 'zero' is not a time in seconds, expected t tx ty tz qx qy qz qw"},
          {Text("groundtruth.txt", "0 0 0 zero 0 0 0 1\n"),
           "@/groundtruth.txt:1: '0 0 zero 0 0 0 1' is not a pose: expected seven numbers tx ty tz "
           "qx qy qz qw"},
          {Text("groundtruth.txt", "0 0 0 0 0 0 0 1\nnan 1 0 0 0 0 0 1\n"),
           "@/groundtruth.txt:2: 'nan' is not a time in seconds, expected t tx ty tz qx qy qz qw"},
          {Text("groundtruth.txt", "0 0 0 0 0 0 0 9\n"),
           "@/groundtruth.txt:1: '0 0 0 0 0 0 9' is not a pose: the quaternion's length is "
           "9.000000, not 1"},
          {Text("groundtruth.txt", "7 0 0 0 0 0 0 1\n"),
           "@/groundtruth.txt: no image is within its times, 7.000 to 7.000 s; images are from "
           "0.000 to 0.067 s"},
          {Text("associations.txt", "0 rgb/0.000000.png 0\n"),
           "@/associations.txt:1: 3 words, expected a time and a file twice"},
          {Text("associations.txt", "x rgb/0.000000.png 0 depth/0.000000.png\n"),
           "@/associations.txt:1: 'x' is not a time in seconds"},
          {Text("associations.txt", "0 rgb/0.000000.png 0 rgb/0.000000.png\n"),
           "@/associations.txt: rgb/0.000000.png is 8-bit unsigned with 3 channels and "
           "rgb/0.000000.png is 8-bit unsigned with 3 channels, expected one of them to be depth "
           "(16-bit unsigned with 1 channel)"},
          {Text("associations.txt", "\n"), "@/associations.txt: holds no images"},
          {Copy("associations.txt", "associated.txt"),
           "@: holds both associations.txt and associated.txt, expected one"},
          {Copy("mask", "masks"), "@: holds both mask/ and masks/, expected one"},
          {[](const fs::path& set) {
             Copy("rgb", "rgb2")(set);
             Text("associations.txt",
                  "0 rgb/0.000000.png 0 depth/0.000000.png\n"
                  "0.033333 rgb2/0.000000.png 0.033333 depth/0.033333.png\n")(set);
           },
           "@: frames 0 and 1 have colour images of one name, '0.000000', and so one mask"},
          {Text("associations.txt", "0 /dev/zero 0 depth/0.000000.png\n"),
           "@/associations.txt:1: the path '/dev/zero' is absolute, expected one inside the data's "
           "folder"},
          {Text("associations.txt", "0 rgb/0.000000.png 0 depth/../../x.png\n"),
           "@/associations.txt:1: the path 'depth/../../x.png' holds '..', expected one inside the "
           "data's folder"},
          {[](const fs::path& set) {
             fs::remove(set / "associations.txt");
             Text("rgb.txt", "0 ../other/0.png\n")(set);
           },
           "@/rgb.txt:1: the path '../other/0.png' holds '..', expected one inside the data's "
           "folder"},
          {[](const fs::path& set) {
             fs::remove(set / "associations.txt");
             std::string list;
             for (int i = 0; i < 300; ++i) list += "0 rgb/0.000000.png\n";
             Text("rgb.txt", list)(set);
             Text("depth.txt", list)(set);
           },
           "@: over 100 images an image within 0.02 s, expected times of a recording"},
          {[](const fs::path& set) {
             fs::remove(set / "rgb/0.000000.png");
             ASSERT_EQ(mkfifo((set / "rgb/0.000000.png").c_str(), 0600), 0);
           },
           "@/rgb/0.000000.png: is a pipe, expected a regular file"},
          {[](const fs::path& set) {
             fs::remove(set / "groundtruth.txt");
             fs::create_symlink("/etc/passwd", set / "groundtruth.txt");
           },
           "@/groundtruth.txt: leads by a link to '/etc/passwd', outside of the data's folder "
           "(--follow-links, or a copy in its place, reads it)"},
          {[](const fs::path& set) {
             fs::remove(set / "associations.txt");
             Text("rgb.txt", "9 rgb/0.000000.png\n")(set);
           },
           "@: no colour image is within 0.02 s of a depth image; colour is from 9.000 to 9.000 s, "
           "depth from 0.000 to 0.067 s"},
          {[](const fs::path& set) {
             fs::remove(set / "associations.txt");
             Text("depth.txt", "0 depth/0.000000.png extra\n")(set);
           },
           "@/depth.txt:1: 3 words, expected a time and a file"},
          {Remove(depth), In(depth, ": no such image")},
          {Text(depth, "not a PNG"), In(depth, ": cannot be decoded as an image")},
          {Cut(depth), In(depth, ": cannot be decoded as an image")},
          {Image(depth, kByteDepth),
           In(depth,
              ": depth is 8-bit unsigned with 1 channel, expected 16-bit unsigned with "
              "1 channel")},
          {Image(depth, kColourDepth),
           In(depth,
              ": depth is 8-bit unsigned with 3 channels, expected 16-bit unsigned "
              "with 1 channel")},
          {Image(depth, kSmallDepth),
           In(depth, ": the image is 32x24, expected 64x48 (calibration.txt)")},
          {Image("rgb/0.033333.png", kSmallColour),
           "@/rgb/0.033333.png: the image is 32x24, expected 64x48 (calibration.txt)"},
          {Image("mask/0.033333.png", kSmallMask),
           "@/mask/0.033333.png: the image is 32x24, expected 64x48 (calibration.txt)"},
          {Remove("mask/0.033333.png"),
           "@/mask/0.033333.png: no such mask, though mask/ is there; expected one for every "
           "frame"},
          {Text("calibration.txt", "60 61 120 23.75 64 48\n"),
           "set, frame 0: the principal point (120, 23.75) is far from the middle of the 64x48 "
           "image: intrinsics of another resolution"},
          {Text("calibration.txt", "6 6 31 23 64 48\n"),
           "set, frame 0: focal lengths 6 and 6 do not fit an image 64 pixels wide, expected 12.8 "
           "to 640"},
          {Text("calibration.txt", "60 61\n"),
           "@/calibration.txt: 2 numbers, expected fx fy cx cy [width height]"},
      });
}

// sequence.klg: 4 bytes, then frames of 16 bytes and their contents.
TEST(Malformed, Klg) {
  const std::string klg = "sequence.klg";
  const auto size_of = [&](int bytes_left_out) {
    return [=](const fs::path& set) {
      fs::resize_file(set / klg, fs::file_size(set / klg) - static_cast<unsigned>(bytes_left_out));
    };
  };
  const auto int32 = [](std::int32_t value) {
    return std::string(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  const auto int64 = [](std::int64_t value) {
    return std::string(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  CheckAll(
      Exported(DatasetFormat::kKlg),
      {
          {Text(klg, ""), "@/sequence.klg: 0 bytes, expected a frame count of 4 bytes and frames"},
          {Text(klg, "ab"),
           "@/sequence.klg: 2 bytes, expected a frame count of 4 bytes and frames"},
          {Bytes(klg, 0, int32(0)),
           "@/sequence.klg: the frame count is 0, expected one over 0 (was the recording stopped "
           "before it was finished?)"},
          {Bytes(klg, 0, int32(-5)),
           "@/sequence.klg: the frame count is -5, expected one over 0 (was the recording stopped "
           "before it was finished?)"},
          {[](const fs::path& set) { fs::resize_file(set / "sequence.klg", 10); },
           "@/sequence.klg: cut short in the header of frame 0 of 3, at byte 10"},
          {[](const fs::path& set) { fs::resize_file(set / "sequence.klg", 4); },
           "@/sequence.klg: cut short in the header of frame 0 of 3, at byte 4"},
          {Bytes(klg, 12, int32(-1)),
           "@/sequence.klg: frame 0 of 3 has -1 bytes of depth and 9216 of colour, expected both "
           "over 0"},
          {Bytes(klg, 0, int32(4)),
           "@/sequence.klg: cut short in the header of frame 3 of 4, at byte ?"},
          {size_of(1), "@/sequence.klg: cut short in frame 2 of 3: it needs ? bytes, ? are left"},
          {Bytes(klg, 12, int32(0x7fffffff)),
           "@/sequence.klg: cut short in frame 0 of 3: it needs 2147492863 bytes, ? are left"},
          {Bytes(klg, 4, int64(40000)),
           "@/sequence.klg: the time of frame 1 is 33333 us, not after that of the frame before, "
           "40000"},
          {Bytes(klg, 20, "nothing that zlib wrote"),
           "@/sequence.klg, frame 0: the depth: cannot be unpacked by zlib"},
          {Text("calibration.txt", "8000 8000 8191.5 8191.5 16384 16384\n"),
           "@/sequence.klg: 268435456 pixels in the image, over the limit of 100000000 "
           "(TSDFPP_LIMITS=image_pixels=... raises it)"},
          {Text("calibration.txt", "60 61 31.25 23.75 66 48\n"),
           "@/sequence.klg, frame 0: the depth: unpacks to 6144 bytes, expected 6336 (16 bits a "
           "pixel)"},
          {Text("calibration.txt", "60 61 31.25 23.75 62 48\n"),
           "@/sequence.klg, frame 0: the depth: unpacks to more bytes, expected 5952 (16 bits a "
           "pixel)"},
          {Remove("groundtruth.txt"),
           "@/sequence.klg: a .klg holds no camera poses, expected groundtruth.txt (t tx ty tz qx "
           "qy qz qw) beside it, or leave to take the camera as fixed"},
          {Text("groundtruth.txt", "50 0 0 0 0 0 0 1"),
           "@/groundtruth.txt: no frame of sequence.klg is within its times"},
          {Remove("mask/000001.png"),
           "@/mask/000001.png: no such mask, though mask/ is there; expected one for every frame"},
          {[](const fs::path& set) { fs::copy_file(set / "sequence.klg", set / "second.klg"); },
           "@: 2 .klg files in it, expected one, or the path of one"},
      });
}

TEST(Malformed, SevenScenes) {
  const std::string pose = "frame-000001.pose.txt";
  const std::string depth = "frame-000001.depth.png";
  CheckAll(
      Exported(DatasetFormat::kSevenScenes),
      {
          {Remove(pose), In(pose, ": no such file")},
          {Text(pose, "1 0 0 0\n0 1 0 0\n0 0 1 0\n"),
           In(pose, ": 12 numbers, expected the 16 of a 4x4 camera-to-world matrix")},
          {Text(pose, "1 0 0 0\n0 one 0 0\n0 0 1 0\n0 0 0 1\n"),
           In(pose, ":2: 'one' is not a number")},
          {Text(pose, "1 0 0 0\n0 1 0 0\n0 0 1 nan\n0 0 0 1\n"),
           In(pose, ": the pose holds numbers that are not finite")},
          {Text(pose, "1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n"),
           In(pose, ": the matrix's last row is 1 2 3 1, expected 0 0 0 1")},
          {Text(pose, "1 0 0.1 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"),
           In(pose, ": the rotation is not orthonormal (R^T R is off by 0.1, allowed 0.002)")},
          {Text("camera-intrinsics.txt", "585 585 320 240\n"),
           "@/camera-intrinsics.txt: not a camera matrix, expected fx 0 cx, 0 fy cy, 0 0 1 (3x3 or "
           "4x4)"},
          {Text("camera-intrinsics.txt", "-60 0 31 0 60 24 0 0 1\n"),
           "@/camera-intrinsics.txt: focal lengths -60 and 60, expected both over 0"},
          {Remove("camera-intrinsics.txt"),
           "@/frame-000000.depth.png: the image is 64x48, expected 640x480 (7-Scenes' default "
           "camera)"},
          {Text("camera-intrinsics.txt", "525 0 319.5 0 525 239.5 0 0 1\n"),
           "set, frame 0: the principal point (319.5, 239.5) is far from the middle of the 64x48 "
           "image: intrinsics of another resolution"},
          {Image(depth, kSmallDepth),
           In(depth, ": the image is 32x24, expected 64x48 (as frame-000000.depth.png)")},
          {Copy("frame-000001.color.png", "frame-000001.color.jpg"),
           "@/frame-000001.color.png: there is frame-000001.color.jpg as well, expected one of "
           "them"},
          {Cut(depth), In(depth, ": cannot be decoded as an image")},
          {Remove("frame-000001.color.png"), "@/frame-000001.color.png: no such image"},
          {Remove("frame-000001.mask.png"),
           "@/frame-000001.mask.png: no such mask, though other frames have one"},
          {Image("frame-000001.mask.png", cv::Mat(48, 64, CV_8UC3, cv::Scalar(1, 2, 3))),
           "@/frame-000001.mask.png: the mask is coloured, expected ids as 8-bit grey or as RGB "
           "with equal channels"},
      });
}

TEST(Malformed, Replica) {
  CheckAll(
      [](FrameSource& source, const fs::path& set) { WriteReplica(source, set); },
      {
          {Remove("cam_params.json"), "UP/cam_params.json: no such file"},
          {Text("cam_params.json", "w 64"), "@/cam_params.json: not a JSON object"},
          {Text("cam_params.json", "{\"camera\": {\"w\": 64}}"),
           "@/cam_params.json: expected numbers w h fx fy cx cy scale"},
          {Json("cam_params.json", [](nlohmann::json& json) { json["camera"]["scale"] = 0; }),
           "@/cam_params.json: w, h and scale must be over 0, w and h whole numbers"},
          {Json("cam_params.json", [](nlohmann::json& json) { json["camera"]["w"] = 60; }),
           "@/results/depth000000.png: the image is 64x48, expected 60x48 (cam_params.json)"},
          // Metres where the file says millimetres.
          {Json("cam_params.json", [](nlohmann::json& json) { json["camera"]["scale"] = 1; }),
           "set: the median depth of frame 0 is 9.9e+03 m at 1 units a metre, expected 0.05 to 50 "
           "m: another unit; 1000 would give 9.89 m, 5000 would give 1.98 m, 6553.5 would give "
           "1.51 m, 10000 would give 0.99 m"},
          {Text("traj.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"),
           "@/traj.txt: 1 poses, none for depth000001.png"},
          {[](const fs::path& set) {
             std::ofstream(set / "traj.txt", std::ios::app) << "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n";
           },
           "@/traj.txt: 4 poses, but 3 depth images in results/"},
          {Text("traj.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"),
           "@/traj.txt:1: 4 numbers, expected the 16 of a 4x4 camera-to-world matrix"},
          {Text("traj.txt", "1 0 0 0 0 x 0 0 0 0 1 0 0 0 0 1\n"),
           "@/traj.txt:1: 'x' is not a number"},
          {Remove("results/frame000001.jpg"), "@/results/frame000001.jpg: no such image"},
          {Copy("results/frame000001.jpg", "results/frame000001.png"),
           "@/results/frame000001.jpg: there is frame000001.png as well, expected one of them"},
          {Cut("results/depth000001.png"),
           "@/results/depth000001.png: cannot be decoded as an image"},
      });
}

TEST(Malformed, Scannet) {
  CheckAll(
      [](FrameSource& source, const fs::path& set) { WriteScannet(source, set); },
      {
          {Remove("pose/10.txt"), "@/pose/10.txt: no such file"},
          {Text("pose/10.txt", "1 2 3"),
           "@/pose/10.txt: 3 numbers, expected the 16 of a 4x4 camera-to-world matrix"},
          {[](const fs::path& set) {
             for (const char* file : {"pose/0.txt", "pose/10.txt"}) Text(file, "inf")(set);
           },
           "@/pose: the poses of all 3 frames are infinite"},
          {[](const fs::path& set) {
             fs::remove_all(set / "depth");
             fs::create_directories(set / "depth");
           },
           "@/depth: no image named 0.png or so"},
          {Remove("instance-filt/10.png"),
           "@/instance-filt/10.png: no such mask, though instance-filt/ is there; expected one for "
           "every frame"},
          {Image("instance-filt/10.png", kSmallMask),
           "@/instance-filt/10.png: the image is 32x24, expected 128x96 (as 0.png)"},
          {Remove("color/10.png"), "@/color/10.jpg: no such image"},
          {Copy("color/10.png", "color/10.jpg"),
           "@/color/10.jpg: there is 10.png as well, expected one of them"},
          {Text("intrinsic/intrinsic_depth.txt", "60 0 31 0\n"),
           "@/intrinsic/intrinsic_depth.txt: not a camera matrix, expected fx 0 cx, 0 fy cy, 0 0 1 "
           "(3x3 or 4x4)"},
          {Remove("intrinsic/intrinsic_color.txt"),
           "@/color/0.png: the image is 128x96, expected 64x48 (as 0.png)"},
          {Image("depth/10.png", kColourDepth),
           "@/depth/10.png: depth is 8-bit unsigned with 3 channels, expected 16-bit unsigned with "
           "1 channel"},
      });
}

TEST(Malformed, OptionsThatDoNotFit) {
  const TempFolder folder;
  WriteForeignSet(folder / "room");
  SequenceOptions options;
  options.depth_units_per_m = 1000;
  const auto scaled = OpenSequence(folder / "room", options);
  ASSERT_FALSE(scaled.has_value());
  EXPECT_EQ(scaled.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(scaled.error().message,
            (folder / "room").string() +
                ": a Co-Fusion set has its own calibration, metres and camera poses, expected no "
                "others");
  BoxSource source(2);
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kBop, folder / "bop").has_value());
  options.intrinsics = source.info().intrinsics;
  options.intrinsics->fy = -61;
  const auto mirrored = OpenSequence(folder / "bop", options);
  ASSERT_FALSE(mirrored.has_value());
  EXPECT_EQ(mirrored.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(mirrored.error().message, "bop-000000: a negative fy does not fit objects with poses");
  options = {};
  options.fixed_camera = true;
  const auto fixed = OpenSequence(folder / "bop", options);
  ASSERT_FALSE(fixed.has_value());
  EXPECT_EQ(fixed.error().kind, ErrorKind::kUsage);
  EXPECT_NE(fixed.error().message.find("has camera poses, expected none"), std::string::npos);
  options = {};
  options.format = DatasetFormat::kBop;
  const auto forced = OpenSequence(folder / "room", options);
  ASSERT_FALSE(forced.has_value());
  EXPECT_EQ(forced.error().message,
            (folder / "room").string() +
                ": no scene_camera.json here and 0 scenes below, expected the folder of one scene");
}

}  // namespace
}  // namespace tsdfpp::test
