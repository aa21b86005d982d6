// Stands in for core/decode_image.cc where readers are fuzzed: OpenCV's codecs, which bring 180 MB
// of libraries, are not what is tested. All checks are made; the pixels of an image of the header's
// size and type are the file's last bytes, over and over. Tests replay the inputs with the codecs.
#include <limits>

#include "core/decode_image.h"
#include "core/files.h"

namespace tsdfpp {
namespace {

// Depths from 0 to some 12 m, and what is none.
float DepthOf(unsigned char byte) {
  switch (byte) {
    case 253:
      return -1;
    case 254:
      return std::numeric_limits<float>::infinity();
    case 255:
      return std::numeric_limits<float>::quiet_NaN();
    default:
      return static_cast<float>(byte) / 20;
  }
}

Expected<cv::Mat> Stand(std::string_view bytes, const std::string& where, DecodeAs as,
                        const HeaderCheck& check, bool is_file) {
  TSDFPP_ASSIGN(const ImageHeader header, ReadImageHeader(bytes, where));
  if (check) TSDFPP_RETURN_IF_ERROR(check(header, bytes));
  const bool is_exr = header.format == ImageFormat::kExr;
  // What OpenCV does not decode either.
  if ((is_exr && !is_file) || header.channels < 1 || header.channels > 4) {
    return DataError("{}: cannot be decoded as an image", where);
  }
  const bool as_colour = as == DecodeAs::kColour;
  int depth = CV_8U;
  if (!as_colour && header.bits == 16) depth = CV_16U;
  if (!as_colour && is_exr) depth = CV_32F;
  const int channels = as_colour ? 3 : (header.channels == 2 ? 4 : header.channels);
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width),
                CV_MAKETYPE(depth, channels));
  constexpr std::size_t kMostPattern = 64;
  const std::string_view pattern =
      bytes.substr(bytes.size() - std::min(bytes.size(), kMostPattern));
  std::size_t at = 0;
  const auto next = [&] { return static_cast<unsigned char>(pattern[at++ % pattern.size()]); };
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols * channels; ++x) {
      if (depth == CV_8U) image.ptr<std::uint8_t>(y)[x] = next();
      if (depth == CV_16U) {
        image.ptr<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(next() | next() << 8U);
      }
      if (depth == CV_32F) image.ptr<float>(y)[x] = DepthOf(next());
    }
  }
  return image;
}

}  // namespace

Expected<cv::Mat> DecodeImage(std::string_view bytes, const std::string& where, DecodeAs as,
                              const HeaderCheck& check) {
  return Stand(bytes, where, as, check, false);
}

Expected<cv::Mat> ReadImageFile(const std::filesystem::path& path, DecodeAs as,
                                const HeaderCheck& check) {
  std::error_code code;
  if (std::filesystem::status(path, code).type() == std::filesystem::file_type::not_found) {
    return DataError("{}: no such image", path.string());
  }
  TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
  return Stand(bytes, path.string(), as, check, true);
}

}  // namespace tsdfpp
