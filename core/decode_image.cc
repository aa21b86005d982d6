#include "core/decode_image.h"

#include <cstdlib>
#include <limits>
#include <mutex>
#include <opencv2/imgcodecs.hpp>

#include "core/address_space.h"
#include "core/files.h"
#include "core/image_codecs.h"
#include "core/quiet_stderr.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

// OpenCV looks at this variable when it first meets an EXR file, and refuses the file without it.
void EnableExr() {
  static std::once_flag once;
  std::call_once(once, [] { setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1); });
}

// Of an EXR image OpenCV reads files only; `path` is where the bytes are from, or empty.
Expected<cv::Mat> DecodeBytes(std::string_view bytes, const std::string& where, DecodeAs as,
                              const HeaderCheck& check, const fs::path& path) {
  TSDFPP_ASSIGN(const ImageHeader header, ReadImageHeader(bytes, where));
  if (check) TSDFPP_RETURN_IF_ERROR(check(header, bytes));
  // Turned, it would lie beside other images of its frame and the camera's numbers.
  if (header.orientation != 1) {
    return DataError("{}: is to be turned or mirrored, orientation {}, expected 1", where,
                     header.orientation);
  }
  if (header.format == ImageFormat::kJpeg && !IsWholeJpeg(bytes)) {
    return DataError("{}: ends before its image does, expected a whole JPEG", where);
  }
  if (as == DecodeAs::kNumbers && header.format == ImageFormat::kJpeg) {
    return DataError("{}: is a JPEG, whose values are approximate, expected another format", where);
  }
  if (as == DecodeAs::kNumbers && header.is_stretched) {
    return DataError(
        "{}: its values are stretched to 0 to 255 when they are read, expected 8 or 16 bits a "
        "value",
        where);
  }
  const int flags = as == DecodeAs::kColour ? cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION
                                            : cv::IMREAD_UNCHANGED;
  const bool is_exr = header.format == ImageFormat::kExr;
  cv::Mat image;
  // What OpenCV counts the bytes with.
  constexpr auto kMostBytes = static_cast<std::size_t>(std::numeric_limits<int>::max());
  if (bytes.size() <= kMostBytes && !(is_exr && path.empty())) {
    if (is_exr) EnableExr();
    const auto codecs = LoadImageCodecs();
    if (!codecs) return EnvironmentError("{}: {}", where, codecs.error().message);
    const QuietStderr quiet;
    try {
      if (is_exr) {
        image = codecs->read(path.string(), flags);
      } else {
        image = codecs->decode(
            cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data())),
            flags);
      }
    } catch (const std::exception&) {  // OpenCV's, and what its codecs throw
      image.release();
    }
  }
  if (image.empty() && IsOutOfAddressSpace()) {
    return EnvironmentError("{}: out of memory, so it cannot be decoded", where);
  }
  if (image.empty()) return DataError("{}: cannot be decoded as an image", where);
  // Callers rely on what was checked of the header.
  if (image.cols != header.width || image.rows != header.height) {
    return DataError("{}: the image is {}x{}, expected {}x{} (its header)", where, image.cols,
                     image.rows, header.width, header.height);
  }
  return image;
}

}  // namespace

Expected<cv::Mat> DecodeImage(std::string_view bytes, const std::string& where, DecodeAs as,
                              const HeaderCheck& check) {
  return DecodeBytes(bytes, where, as, check, {});
}

Expected<cv::Mat> ReadImageFile(const fs::path& path, DecodeAs as, const HeaderCheck& check) {
  std::error_code code;
  if (fs::status(path, code).type() == fs::file_type::not_found) {
    return DataError("{}: no such image", path.string());
  }
  TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
  return DecodeBytes(bytes, path.string(), as, check, path);
}

}  // namespace tsdfpp
