#include "tests/sequence/other_sets.h"

#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace tsdfpp::test {
namespace {

namespace fs = std::filesystem;

cv::Mat Units(const cv::Mat& depth_m, double units_per_m) {
  cv::Mat units;
  depth_m.convertTo(units, CV_16U, units_per_m);
  return units;
}

// Blue first, each pixel `times` by `times` pixels large.
cv::Mat Bgr(const cv::Mat& rgb, int times) {
  cv::Mat bgr(rgb.rows * times, rgb.cols * times, CV_8UC3);
  for (int y = 0; y < bgr.rows; ++y) {
    for (int x = 0; x < bgr.cols; ++x) {
      const auto& pixel = rgb.at<cv::Vec3b>(y / times, x / times);
      bgr.at<cv::Vec3b>(y, x) = cv::Vec3b(pixel[2], pixel[1], pixel[0]);
    }
  }
  return bgr;
}

void WriteMatrix(std::ostream& out, const Eigen::Matrix4d& matrix, const char* row_end) {
  out.precision(17);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) out << matrix(row, column) << ' ';
    out << row_end;
  }
}

}  // namespace

void WriteReplica(FrameSource& source, const fs::path& set, bool beside) {
  fs::create_directories(set / "results");
  const SequenceInfo& info = source.info();
  const Intrinsics& k = info.intrinsics;
  std::ofstream((beside ? set.parent_path() : set) / "cam_params.json") << fmt::format(
      R"({{"camera": {{"w": {}, "h": {}, "fx": {}, "fy": {}, "cx": {}, "cy": {}, "scale": 6553.5}}}})",
      k.width, k.height, k.fx, k.fy, k.cx, k.cy);
  std::ofstream trajectory(set / "traj.txt");
  for (int i = 0; i < info.frame_count; ++i) {
    const Frame frame = source.Read(info.first_index + i).value();
    cv::imwrite((set / fmt::format("results/frame{:06d}.jpg", i)).string(), Bgr(frame.colour, 1));
    cv::imwrite((set / fmt::format("results/depth{:06d}.png", i)).string(),
                Units(frame.depth, 6553.5));
    WriteMatrix(trajectory, frame.T_WC.matrix(), "");
    trajectory << '\n';
  }
}

void WriteScannet(FrameSource& source, const fs::path& set) {
  for (const char* folder : {"color", "depth", "pose", "intrinsic", "instance-filt"}) {
    fs::create_directories(set / folder);
  }
  const SequenceInfo& info = source.info();
  const Intrinsics& k = info.intrinsics;
  Eigen::Matrix4d camera = Eigen::Matrix4d::Identity();
  camera(0, 0) = k.fx;
  camera(1, 1) = k.fy;
  camera(0, 2) = k.cx;
  camera(1, 2) = k.cy;
  std::ofstream depth_camera(set / "intrinsic/intrinsic_depth.txt");
  WriteMatrix(depth_camera, camera, "\n");
  // Of an image of twice the size: pixel (x, y) is the middle of pixels 2x, 2x + 1.
  camera.topRows<2>() *= 2;
  camera(0, 2) += 0.5;
  camera(1, 2) += 0.5;
  std::ofstream colour_camera(set / "intrinsic/intrinsic_color.txt");
  WriteMatrix(colour_camera, camera, "\n");
  for (int i = 0; i < info.frame_count; ++i) {
    const Frame frame = source.Read(info.first_index + i).value();
    const std::string stem = std::to_string(10 * i);
    cv::imwrite((set / "color" / (stem + ".png")).string(), Bgr(frame.colour, 2));
    cv::imwrite((set / "depth" / (stem + ".png")).string(), Units(frame.depth, 1000));
    cv::Mat ids(frame.mask.rows * 2, frame.mask.cols * 2, CV_8UC1);
    for (int y = 0; y < ids.rows; ++y) {
      for (int x = 0; x < ids.cols; ++x) {
        ids.at<std::uint8_t>(y, x) =
            static_cast<std::uint8_t>(frame.mask.at<InstanceId>(y / 2, x / 2));
      }
    }
    cv::imwrite((set / "instance-filt" / (stem + ".png")).string(), ids);
    std::ofstream pose(set / "pose" / (stem + ".txt"));
    Eigen::Matrix4d T_WC = frame.T_WC.matrix();
    if (i == 2) T_WC.setConstant(-std::numeric_limits<double>::infinity());
    WriteMatrix(pose, T_WC, "\n");
  }
}

bool NotesSay(const SequenceNotes& notes, const std::string& words) {
  for (const std::string& note : notes) {
    if (note.find(words) != std::string::npos) return true;
  }
  return false;
}

}  // namespace tsdfpp::test
