#include "core/image_header.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <opencv2/imgcodecs.hpp>

#include "core/decode_image.h"
#include "core/files.h"
#include "core/limits.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using test::TempFolder;
using namespace std::string_literals;

std::string Encoded(const char* ending, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  EXPECT_TRUE(cv::imencode(ending, image, bytes)) << ending;
  return {bytes.begin(), bytes.end()};
}

std::string BigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) {
    bytes += static_cast<char>(value >> static_cast<unsigned>(shift) & 0xFFU);
  }
  return bytes;
}

// A PNG's first chunk, of one grey byte a pixel.
std::string PngBegin(std::uint32_t width, std::uint32_t height) {
  return "\x89PNG\r\n\x1a\n"s + BigEndian(13) + "IHDR" + BigEndian(width) + BigEndian(height) +
         "\x08\0\0\0\0"s + "crc!";
}

TEST(ImageHeader, IsThatOfWhatOpenCvWrites) {
  const cv::Mat grey(37, 53, CV_8UC1, cv::Scalar(9));
  const cv::Mat colour(37, 53, CV_8UC3, cv::Scalar(1, 2, 3));
  const cv::Mat deep(37, 53, CV_16UC1, cv::Scalar(40000));
  struct Case {
    const char* ending;
    const cv::Mat* image;
    ImageFormat format;
    int channels;
    int bits;
  };
  for (const Case& c : {Case{".png", &grey, ImageFormat::kPng, 1, 8},
                        {".png", &colour, ImageFormat::kPng, 3, 8},
                        {".png", &deep, ImageFormat::kPng, 1, 16},
                        {".jpg", &grey, ImageFormat::kJpeg, 1, 8},
                        {".jpg", &colour, ImageFormat::kJpeg, 3, 8},
                        {".pgm", &grey, ImageFormat::kPnm, 1, 8},
                        {".pgm", &deep, ImageFormat::kPnm, 1, 16},
                        {".ppm", &colour, ImageFormat::kPnm, 3, 8},
                        {".tiff", &colour, ImageFormat::kTiff, 3, 8},
                        {".tiff", &deep, ImageFormat::kTiff, 1, 16},
                        {".bmp", &colour, ImageFormat::kBmp, 3, 8},
                        {".webp", &colour, ImageFormat::kWebp, 3, 8}}) {
    const std::string bytes = Encoded(c.ending, *c.image);
    const auto header = ReadImageHeader(bytes, "x");
    ASSERT_TRUE(header.has_value()) << c.ending << ": " << header.error().message;
    EXPECT_EQ(header->format, c.format) << c.ending;
    EXPECT_EQ(header->width, 53) << c.ending;
    EXPECT_EQ(header->height, 37) << c.ending;
    EXPECT_EQ(header->channels, c.channels) << c.ending;
    EXPECT_EQ(header->bits, c.bits) << c.ending;
    const auto decoded = DecodeImage(bytes, "x");
    ASSERT_TRUE(decoded.has_value()) << c.ending << ": " << decoded.error().message;
    EXPECT_EQ(decoded->size(), cv::Size(53, 37));
    // Cut anywhere in its header it is refused, never read beyond its end.
    for (std::size_t size = 0; size < 30; ++size) {
      const auto cut = DecodeImage(bytes.substr(0, size), "x");
      ASSERT_FALSE(cut.has_value()) << c.ending << " " << size;
    }
  }
}

// As a camera on its side would write it. OpenCV turns such a TIFF whatever it is told.
TEST(ImageHeader, TurnedImagesAreRefused) {
  std::string bytes = Encoded(".tiff", cv::Mat(37, 53, CV_8UC3, cv::Scalar(1, 2, 3)));
  ASSERT_EQ(bytes.substr(0, 2), "II");
  const auto number = [&](std::size_t at, std::size_t size) {
    std::size_t value = 0;
    for (std::size_t i = size; i-- > 0;)
      value = value << 8U | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  // The tag of planes (284: stored in one, as without it) becomes that of the orientation.
  const std::size_t directory = number(4, 4);
  bool found = false;
  for (std::size_t i = 0; i < number(directory, 2); ++i) {
    const std::size_t at = directory + 2 + 12 * i;
    if (number(at, 2) != 274 && (number(at, 2) != 284 || found)) continue;
    found = true;
    bytes[at] = 0x12;
    bytes[at + 1] = 0x01;
    bytes[at + 8] = 6;
  }
  ASSERT_TRUE(found);
  const auto refused = DecodeImage(bytes, "x.tiff", DecodeAs::kColour);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().message,
            "x.tiff: is to be turned or mirrored, orientation 6, expected 1");
}

// Where header and decoder read different sizes, what is checked of the one does not hold of the
// other.
TEST(ImageHeader, SizesAreThoseThatAreDecoded) {
  // OpenCV ends a comment at a carriage return, too.
  const std::string pgm = "P5\n#\r4 2 255\n80 45 255\n"s + std::string(80 * 45, '\x07');
  const auto header = ReadImageHeader(pgm, "x.pgm");
  ASSERT_TRUE(header.has_value());
  EXPECT_EQ(header->width, 4);
  EXPECT_EQ(header->height, 2);
  // A TIFF's width in one byte, the rest of its place being something else.
  std::string tiff = Encoded(".tiff", cv::Mat(37, 53, CV_8UC1, cv::Scalar(1)));
  const auto number = [&](std::size_t at, std::size_t size) {
    std::size_t value = 0;
    for (std::size_t i = size; i-- > 0;) {
      value = value << 8U | static_cast<unsigned char>(tiff[at + i]);
    }
    return value;
  };
  const std::size_t directory = number(4, 4);
  for (std::size_t i = 0; i < number(directory, 2); ++i) {
    const std::size_t at = directory + 2 + 12 * i;
    if (number(at, 2) != 256) continue;
    tiff[at + 2] = 1;
    tiff[at + 9] = 1;
  }
  const auto one_byte = ReadImageHeader(tiff, "x.tiff");
  ASSERT_TRUE(one_byte.has_value());
  EXPECT_EQ(one_byte->width, 53);
}

TEST(ImageHeader, NumbersAreNotStretched) {
  const auto decode = [](const std::string& bytes, DecodeAs as) {
    const auto image = DecodeImage(bytes, "x", as);
    return image ? std::to_string(int{image->at<std::uint8_t>(0, 0)}) : image.error().message;
  };
  const std::string refused =
      "x: its values are stretched to 0 to 255 when they are read, expected 8 or 16 bits a value";
  for (const std::string& pnm :
       {"P2\n2 1\n4\n1 1\n"s, "P5\n2 1\n4\n\x01\x01"s, "P1\n2 1\n1 0\n"s}) {
    EXPECT_EQ(decode(pnm, DecodeAs::kNumbers), refused) << pnm;
    EXPECT_NE(decode(pnm, DecodeAs::kAsItIs), refused) << pnm;
  }
  EXPECT_EQ(decode("P2\n2 1\n255\n1 1\n", DecodeAs::kNumbers), "1");
  std::vector<unsigned char> bits;
  cv::imencode(".png", cv::Mat(2, 2, CV_8UC1, cv::Scalar(255)), bits, {cv::IMWRITE_PNG_BILEVEL, 1});
  const std::string png(bits.begin(), bits.end());
  ASSERT_EQ(ReadImageHeader(png, "x")->bits, 1);
  EXPECT_EQ(decode(png, DecodeAs::kNumbers), refused);
  EXPECT_EQ(decode(Encoded(".png", cv::Mat(2, 2, CV_8UC1, cv::Scalar(9))), DecodeAs::kNumbers),
            "9");
}

TEST(ImageHeader, ExrIsReadFromItsFile) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  const TempFolder folder;
  const cv::Mat depth(5, 7, CV_32FC1, cv::Scalar(1.5));
  ASSERT_TRUE(cv::imwrite((folder / "d.exr").string(), depth));
  const std::string bytes = ReadFile(folder / "d.exr").value();
  const auto header = ReadImageHeader(bytes, "x");
  ASSERT_TRUE(header.has_value());
  EXPECT_EQ(header->format, ImageFormat::kExr);
  EXPECT_EQ(header->width, 7);
  EXPECT_EQ(header->height, 5);
  const auto read = ReadImageFile(folder / "d.exr");
  ASSERT_TRUE(read.has_value()) << read.error().message;
  EXPECT_EQ(cv::norm(*read, depth, cv::NORM_INF), 0);
  // A data window of 2^31 pixels a side.
  std::string huge = bytes;
  const std::size_t at = huge.find("dataWindow\0box2i\0"s) + 17 + 4;
  huge.replace(at, 16, std::string(8, '\0') + "\xfe\xff\xff\x7f\xfe\xff\xff\x7f");
  ASSERT_TRUE(WriteFile(folder / "huge.exr", huge).has_value());
  const auto refused = ReadImageFile(folder / "huge.exr");
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().message.find("huge.exr: 2147483647 pixels along a side of the image, "
                                         "over the limit of 16384"),
            std::string::npos)
      << refused.error().message;
}

// A file of a few bytes asks for gigabytes.
TEST(ImageHeader, SizesOverTheLimitsAreRefusedBeforeThePixels) {
  const auto said = [](const std::string& bytes) {
    const auto image = DecodeImage(bytes, "x.png");
    EXPECT_FALSE(image.has_value());
    return image ? std::string() : image.error().message;
  };
  EXPECT_EQ(said(PngBegin(30'000, 30'000)),
            "x.png: 30000 pixels along a side of the image, over the limit of 16384 "
            "(TSDFPP_LIMITS=image_side=... raises it)");
  EXPECT_EQ(said(PngBegin(16'000, 16'000)),
            "x.png: 256000000 pixels in the image, over the limit of 100000000 "
            "(TSDFPP_LIMITS=image_pixels=... raises it)");
  EXPECT_NE(said(PngBegin(0xFFFFFFFF, 0xFFFFFFFF)).find("over the limit"), std::string::npos);
  EXPECT_NE(said("P5\n# a comment\n100000 3\n255\n").find("100000 pixels along a side"),
            std::string::npos);
  EXPECT_NE(said("\xff\xd8\xff\xe0\0\4ab\xff\xff\xc2\0\x11\x08\xff\xff\xff\xff\3"s)
                .find("65535 pixels along a side"),
            std::string::npos);
  EXPECT_NE(said("BM"s + std::string(12, '\0') + "\x28\0\0\0\xff\xff\xff\x7f\1\0\0\x80\1\0\x18\0"s)
                .find("2147483647 pixels along a side"),
            std::string::npos);
}

TEST(ImageHeader, WhatCannotBeIsNoImage) {
  for (const std::string& bytes :
       {""s, "x"s, "not a PNG"s, PngBegin(0, 5), "P5\n0 3\n255\n"s, "P5\n99999999999999999 1\n1\n"s,
        "P5\n"s, "P9\n3 3\n255\n"s, "II*\0\xff\xff\xff\xff"s, "II*\0\x08\0\0\0\xff\xff"s,
        "MM\0*\0\0\0\x08"s, "RIFF0000WEBPVP8X"s, "RIFF0000WEBP????"s, "\xff\xd8\xff"s,
        "\xff\xd8\xff\xe0\0\0"s, "\xff\xd8"s + std::string(1000, '\xff'), "BM"s,
        "\x76\x2f\x31\x01"s, "\x76\x2f\x31\x01\2\0\0\0dataWindow\0box2i\0\xff\xff\xff\xff"s}) {
    const auto image = DecodeImage(bytes, "x");
    ASSERT_FALSE(image.has_value());
    EXPECT_EQ(image.error().message, "x: cannot be decoded as an image");
  }
}

TEST(ImageHeader, TheCallersCheckComesBeforeThePixels) {
  const auto image = DecodeImage(
      PngBegin(5, 4), "x", DecodeAs::kAsItIs, [](const ImageHeader& header, std::string_view) {
        return Expected<void>(DataError("{} by {}", header.width, header.height));
      });
  ASSERT_FALSE(image.has_value());
  EXPECT_EQ(image.error().message, "5 by 4");
}

// Decoders fill up what a cut JPEG lacks.
TEST(ImageHeader, CutJpegsAreRefused) {
  cv::Mat noise(96, 128, CV_8UC3);
  cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
  for (const std::vector<int>& options :
       {std::vector<int>{cv::IMWRITE_JPEG_QUALITY, 90},
        {cv::IMWRITE_JPEG_PROGRESSIVE, 1, cv::IMWRITE_JPEG_RST_INTERVAL, 4},
        {cv::IMWRITE_JPEG_OPTIMIZE, 1}}) {
    std::vector<unsigned char> encoded;
    ASSERT_TRUE(cv::imencode(".jpg", noise, encoded, options));
    const std::string jpeg(encoded.begin(), encoded.end());
    EXPECT_TRUE(DecodeImage(jpeg, "x").has_value());
    EXPECT_TRUE(DecodeImage(jpeg + "what follows", "x").has_value());
    int cut = 0;
    for (std::size_t size = 1; size < jpeg.size(); ++size) {
      cut += DecodeImage(jpeg.substr(0, size), "x").has_value() ? 0 : 1;
    }
    EXPECT_EQ(cut, static_cast<int>(jpeg.size()) - 1);
    EXPECT_EQ(DecodeImage(jpeg.substr(0, jpeg.size() / 2), "x").error().message,
              "x: ends before its image does, expected a whole JPEG");
    EXPECT_EQ(DecodeImage(jpeg, "x", DecodeAs::kNumbers).error().message,
              "x: is a JPEG, whose values are approximate, expected another format");
  }
}

// What a codec prints comes neither before our sentence nor in its place.
TEST(ImageHeader, DamagedPixelsAreRefusedInSilence) {
  const std::string png = Encoded(".png", cv::Mat(64, 64, CV_8UC3, cv::Scalar(1, 2, 3)));
  std::string jpeg = Encoded(".jpg", cv::Mat(64, 64, CV_8UC3, cv::Scalar(1, 2, 3)));
  std::string damaged = png;
  for (std::size_t i = 60; i < damaged.size(); i += 3) damaged[i] = '\x55';
  testing::internal::CaptureStderr();
  const auto cut = DecodeImage(png.substr(0, png.size() / 2), "cut.png");
  const auto spoilt = DecodeImage(damaged, "damaged.png");
  DecodeImage(jpeg.substr(0, jpeg.size() / 2), "cut.jpg");
  const std::string printed = testing::internal::GetCapturedStderr();
  EXPECT_FALSE(cut.has_value());
  EXPECT_FALSE(spoilt.has_value());
  EXPECT_EQ(printed, "");
}

}  // namespace
}  // namespace tsdfpp
