#include "sequence/image_files.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <set>
#include <vector>

#include "core/decode_image.h"
#include "core/exr_header.h"
#include "core/one_line.h"
#include "core/types.h"
#include "sequence/image_encoders.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

// A camera has more than one row and column: with one, what maps do between pixels has no meaning.
constexpr std::int64_t kLeastSide_px = 2;

// The size that the header says; an empty `expected` takes any of a camera.
Expected<void> CheckHeaderSize(const ImageHeader& header, cv::Size expected,
                               const std::string& size_source, const std::string& file) {
  if (!expected.empty() && (header.width != expected.width || header.height != expected.height)) {
    return DataError("{}: the image is {}x{}, expected {}x{} ({})", file, header.width,
                     header.height, expected.width, expected.height, size_source);
  }
  if (header.width < kLeastSide_px || header.height < kLeastSide_px) {
    return DataError("{}: the image is {}x{}, expected {} pixels or more each way", file,
                     header.width, header.height, kLeastSide_px);
  }
  return {};
}

Expected<cv::Mat> Decode(const fs::path& path, cv::Size expected,
                         const std::string& size_source = "calibration.txt",
                         DecodeAs as = DecodeAs::kAsItIs) {
  return ReadImageFile(path, as, [&](const ImageHeader& header, std::string_view) {
    return CheckHeaderSize(header, expected, size_source, path.string());
  });
}

cv::Mat SwapRedAndBlue(const cv::Mat& image) {
  cv::Mat swapped(image.size(), CV_8UC3);
  const int pairs[] = {0, 2, 1, 1, 2, 0};
  cv::mixChannels(&image, 1, &swapped, 1, pairs, 3);
  return swapped;
}

// The first channel, if the first three agree bit for bit.
template <typename T>
bool TakeEqualChannel(const cv::Mat& image, cv::Mat& channel) {
  const auto bits = [](T value) { return std::bit_cast<std::array<std::byte, sizeof(T)>>(value); };
  const int channels = image.channels();
  channel.create(image.size(), CV_MAKETYPE(image.depth(), 1));
  for (int y = 0; y < image.rows; ++y) {
    const T* pixel = image.ptr<T>(y);
    for (int x = 0; x < image.cols; ++x, pixel += channels) {
      if (bits(pixel[1]) != bits(pixel[0]) || bits(pixel[2]) != bits(pixel[0])) return false;
      channel.at<T>(y, x) = pixel[0];
    }
  }
  return true;
}

// The median of the positive finite depths where most of them are too far to be metres and just
// right for millimetres; 0 otherwise.
float MillimetreMedian(const cv::Mat& depth) {
  constexpr float kFarthestIndoors_mm = 20000.0F;
  std::size_t positive = 0;
  std::size_t far = 0;
  for (int y = 0; y < depth.rows; ++y) {
    for (const float z : cv::Mat_<float>(depth.row(y))) {
      if (!std::isfinite(z) || z <= 0) continue;
      ++positive;
      if (z > kMaxValidDepth_m) ++far;
    }
  }
  if (2 * far <= positive) return 0;
  std::vector<float> depths;
  for (const float z : cv::Mat_<float>(depth)) {
    if (std::isfinite(z) && z > 0) depths.push_back(z);
  }
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle <= kFarthestIndoors_mm ? *middle : 0;
}

// Depth must be one floating-point channel, Y, or three, R, G and B.
Expected<void> CheckDepthChannels(std::string_view bytes, const std::string& file) {
  const auto header = ReadExrHeader(bytes);
  if (!header) return {};  // not an EXR file: its type says what it is
  std::set<std::string> names;
  for (const ExrChannel& channel : header->channels) {
    names.insert(channel.name);
    if (channel.type == ExrType::kInteger) {
      return DataError("{}: depth of an integer type (channel {}), expected 32-bit float metres",
                       file, OneLine(channel.name, 100));
    }
    if (!channel.has_all_pixels) {
      return DataError("{}: channel {} does not hold every pixel, expected sampling rates of 1",
                       file, OneLine(channel.name, 100));
    }
  }
  const bool colours = names.contains("R") && names.contains("G") && names.contains("B");
  if (!colours && names != std::set<std::string>{"Y"}) {
    return DataError("{}: depth in channels {}, expected Y, or R, G and B", file,
                     OneLine(fmt::format("{}", fmt::join(names, " ")), 100));
  }
  return {};
}

// Red, green and blue of an image as OpenCV decodes it, whose order is the reverse.
Expected<cv::Mat> ColourOf(const cv::Mat& image, const std::string& file) {
  if (image.type() != CV_8UC3 && image.type() != CV_8UC4) {
    return DataError("{}: the image is {}, expected 8-bit RGB", file, ImageTypeName(image));
  }
  return SwapRedAndBlue(image);
}

}  // namespace

std::string ImageTypeName(const cv::Mat& image) {
  static constexpr const char* kDepths[] = {"8-bit unsigned", "8-bit signed",   "16-bit unsigned",
                                            "16-bit signed",  "32-bit integer", "32-bit float",
                                            "64-bit float",   "16-bit float"};
  return fmt::format("{} with {} channel{}", kDepths[image.depth()], image.channels(),
                     image.channels() == 1 ? "" : "s");
}

Expected<void> CheckImageSize(const cv::Mat& image, cv::Size expected,
                              const std::string& size_source, const std::string& file) {
  if (expected.empty() || image.size() == expected) return {};
  return DataError("{}: the image is {}x{}, expected {}x{} ({})", file, image.cols, image.rows,
                   expected.width, expected.height, size_source);
}

Expected<cv::Mat> ReadImage(const fs::path& path, DecodeAs as) { return Decode(path, {}, "", as); }

Expected<cv::Mat> DecodeColour(const std::string& bytes, const std::string& file) {
  TSDFPP_ASSIGN(const cv::Mat image, DecodeImage(bytes, file));
  return ColourOf(image, file);
}

Expected<std::string> EncodePng(const cv::Mat& image, const std::string& file) {
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_16UC1)) {
    return DataError("{}: the image is {}, expected 8-bit or 16-bit unsigned with 1 channel", file,
                     ImageTypeName(image));
  }
  return PngFile(image);
}

Expected<std::string> EncodeColour(const cv::Mat& colour, const std::string& file) {
  if (colour.empty() || colour.type() != CV_8UC3) {
    return DataError("{}: the colour image is {}, expected 8-bit RGB", file, ImageTypeName(colour));
  }
  return PngFile(colour);
}

Expected<std::string> EncodeDepth(const cv::Mat& depth, const std::string& file) {
  if (depth.empty() || depth.type() != CV_32FC1) {
    return DataError("{}: the depth image is {}, expected 32-bit float with 1 channel", file,
                     ImageTypeName(depth));
  }
  return ExrFile(depth);
}

Expected<std::string> EncodeMask(const cv::Mat& mask, const std::string& file) {
  if (mask.empty() || mask.type() != CV_16UC1) {
    return DataError("{}: the mask is {}, expected 16-bit unsigned with 1 channel", file,
                     ImageTypeName(mask));
  }
  double largest = 0;
  cv::minMaxLoc(mask, nullptr, &largest);
  if (largest > 255) {
    return DataError("{}: the mask holds id {}, a Co-Fusion mask holds 0 to 255", file, largest);
  }
  cv::Mat bytes;
  mask.convertTo(bytes, CV_8U);
  return PngFile(bytes);
}

Expected<cv::Mat> ReadColour(const fs::path& path, cv::Size expected,
                             const std::string& size_source) {
  TSDFPP_ASSIGN(const cv::Mat image, Decode(path, expected, size_source));
  return ColourOf(image, path.string());
}

Expected<cv::Mat> ReadDepth(const fs::path& path, cv::Size expected) {
  std::error_code code;
  if (!fs::exists(path, code)) {
    for (const char* extension : {".png", ".pgm", ".tiff", ".tif"}) {
      const fs::path other = fs::path(path).replace_extension(extension);
      if (fs::exists(other, code)) {
        return DataError("{}: depth of an integer type, expected {} in 32-bit float metres",
                         other.string(), path.filename().string());
      }
    }
  }
  const auto check = [&](const ImageHeader& header, std::string_view bytes) -> Expected<void> {
    TSDFPP_RETURN_IF_ERROR(CheckDepthChannels(bytes, path.string()));
    return CheckHeaderSize(header, expected, "calibration.txt", path.string());
  };
  TSDFPP_ASSIGN(cv::Mat depth, ReadImageFile(path, DecodeAs::kAsItIs, check));
  if (depth.depth() != CV_32F) {
    return DataError("{}: depth is {}, expected 32-bit float metres", path.string(),
                     ImageTypeName(depth));
  }
  if (depth.channels() >= 3) {
    cv::Mat channel;
    if (!TakeEqualChannel<float>(depth, channel)) {
      return DataError("{}: depth has {} channels that differ, expected one or three equal ones",
                       path.string(), depth.channels());
    }
    depth = channel;
  } else if (depth.channels() != 1) {
    return DataError("{}: depth has {} channels, expected one or three equal ones", path.string(),
                     depth.channels());
  }
  if (const float median = MillimetreMedian(depth); median > 0) {
    return DataError(
        "{}: the median depth is {:.0f}, which looks like millimetres, expected metres",
        path.string(), median);
  }
  return depth;
}

Expected<cv::Mat> ReadMask(const fs::path& path, cv::Size expected) {
  TSDFPP_ASSIGN(cv::Mat mask, Decode(path, expected, "calibration.txt", DecodeAs::kNumbers));
  if (mask.depth() != CV_8U || mask.channels() == 2) {
    return DataError("{}: the mask is {}, expected 8-bit grey ids", path.string(),
                     ImageTypeName(mask));
  }
  if (mask.channels() >= 3) {
    cv::Mat channel;
    if (!TakeEqualChannel<std::uint8_t>(mask, channel)) {
      return DataError(
          "{}: the mask is coloured, expected ids as 8-bit grey or as RGB with equal channels",
          path.string());
    }
    mask = channel;
  }
  cv::Mat ids;
  mask.convertTo(ids, CV_16U);
  return ids;
}

Expected<fs::path> OnlyOneOf(const fs::path& first, const fs::path& second) {
  std::error_code code;
  if (!fs::exists(second, code)) return first;
  if (!fs::exists(first, code)) return second;
  return DataError("{}: there is {} as well, expected one of them", first.string(),
                   second.filename().string());
}

}  // namespace tsdfpp
