// Files of our encoders through OpenCV's decoders (libpng, OpenEXR), bit by bit.
#include "sequence/image_encoders.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace tsdfpp {
namespace {

cv::Mat Decoded(const std::string& file) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  return cv::imdecode(std::vector<unsigned char>(file.begin(), file.end()), cv::IMREAD_UNCHANGED);
}

bool SameBytes(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y) {
    const std::size_t row = a.elemSize() * static_cast<std::size_t>(a.cols);
    if (std::memcmp(a.ptr(y), b.ptr(y), row) != 0) return false;
  }
  return true;
}

// One pixel, one row, one column, a whole EXR chunk of 16 rows, one row more, and a usual size.
const std::vector<cv::Size> kSizes{{1, 1}, {37, 1}, {1, 37}, {20, 16}, {21, 17}, {160, 90}};

// Noise, which cannot be packed, and a ramp, which packs well.
cv::Mat Noise(cv::Size size, int type) {
  cv::Mat image(size, type);
  cv::RNG random(7);
  random.fill(image, cv::RNG::UNIFORM, 0, CV_MAT_DEPTH(type) == CV_8U ? 256 : 65536);
  return image;
}

cv::Mat Ramp(cv::Size size, int type) {
  cv::Mat image(size, type);
  for (int y = 0; y < size.height; ++y) image.row(y).setTo(cv::Scalar(y % 200, 2 * y % 200, 3));
  return image;
}

TEST(ImageEncoders, OpenCvReadsOurPngExactly) {
  for (const cv::Size& size : kSizes) {
    for (const int type : {CV_8UC1, CV_8UC3, CV_16UC1}) {
      for (const cv::Mat& image : {Noise(size, type), Ramp(size, type)}) {
        cv::Mat decoded = Decoded(PngFile(image));
        if (type == CV_8UC3 && !decoded.empty()) cv::cvtColor(decoded, decoded, cv::COLOR_BGR2RGB);
        EXPECT_TRUE(SameBytes(decoded, image)) << size << " type " << type;
      }
    }
  }
}

TEST(ImageEncoders, OpenCvReadsOurExrExactly) {
  for (const cv::Size& size : kSizes) {
    cv::Mat ramp = Ramp(size, CV_32FC1);
    ramp.at<float>(0, 0) = std::numeric_limits<float>::infinity();
    cv::Mat bits(size, CV_32FC1);
    cv::RNG random(5);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const std::uint32_t word = random.next() & 0xbfffffffU;  // every bit but a NaN's
        std::memcpy(&bits.at<float>(y, x), &word, sizeof(word));
      }
    }
    for (const cv::Mat& image : {ramp, bits}) {
      EXPECT_TRUE(SameBytes(Decoded(ExrFile(image)), image)) << size;
    }
  }
}

TEST(ImageEncoders, PartsOfALargerImageAreTheirOwnFiles) {
  const cv::Mat whole = Noise({64, 48}, CV_8UC3);
  const cv::Rect part(5, 7, 30, 20);
  EXPECT_EQ(PngFile(whole(part)), PngFile(whole(part).clone()));
  const cv::Mat depth = Ramp({64, 48}, CV_32FC1);
  EXPECT_EQ(ExrFile(depth(part)), ExrFile(depth(part).clone()));
}

}  // namespace
}  // namespace tsdfpp
