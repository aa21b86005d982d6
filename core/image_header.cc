#include "core/image_header.h"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <optional>

#include "core/exr_header.h"
#include "core/limits.h"

namespace tsdfpp {
namespace {

using namespace std::string_view_literals;

// Numbers at places of the bytes; once a place is beyond them, all are 0 and ok() is false.
class HeaderBytes {
 public:
  explicit HeaderBytes(std::string_view bytes) : bytes_(bytes) {}

  std::uint64_t Big(std::size_t at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value = value << 8U | Byte(at + i);
    return value;
  }
  std::uint64_t Little(std::size_t at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value |= Byte(at + i) << (8 * i);
    return value;
  }
  bool ok() const { return ok_; }

 private:
  std::uint64_t Byte(std::size_t at) {
    if (at >= bytes_.size()) {
      ok_ = false;
      return 0;
    }
    return static_cast<unsigned char>(bytes_[at]);
  }

  std::string_view bytes_;
  bool ok_ = true;
};

// As substr, of bytes that may end before.
std::string_view Part(std::string_view file, std::size_t at, std::size_t size) {
  return file.substr(std::min(at, file.size()), size);
}

std::optional<ImageHeader> PngHeader(std::string_view file) {
  HeaderBytes bytes(file);
  if (Part(file, 12, 4) != "IHDR") return std::nullopt;
  ImageHeader header{ImageFormat::kPng, static_cast<std::int64_t>(bytes.Big(16, 4)),
                     static_cast<std::int64_t>(bytes.Big(20, 4)), 0,
                     static_cast<int>(bytes.Big(24, 1))};
  constexpr int kChannels[] = {1, 0, 3, 3, 2, 0, 4};
  const auto type = bytes.Big(25, 1);
  if (!bytes.ok() || type > 6) return std::nullopt;
  header.channels = kChannels[type];
  header.is_stretched = header.channels == 1 && header.bits < 8;
  return header;
}

// Segments up to the frame's header, whichever coding it has.
std::optional<ImageHeader> JpegHeader(std::string_view file) {
  HeaderBytes bytes(file);
  for (std::size_t at = 2; bytes.ok();) {
    if (bytes.Big(at, 1) != 0xFF) return std::nullopt;
    const auto marker = bytes.Big(at + 1, 1);
    if (marker == 0xFF) {  // filling
      ++at;
      continue;
    }
    at += 2;
    if (marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8)) continue;  // without a length
    const bool is_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame) {
      const ImageHeader header{ImageFormat::kJpeg, static_cast<std::int64_t>(bytes.Big(at + 5, 2)),
                               static_cast<std::int64_t>(bytes.Big(at + 3, 2)),
                               static_cast<int>(bytes.Big(at + 7, 1)),
                               static_cast<int>(bytes.Big(at + 2, 1))};
      return bytes.ok() ? std::optional(header) : std::nullopt;
    }
    const auto length = bytes.Big(at, 2);
    if (marker == 0xD9 || marker == 0xDA || length < 2) return std::nullopt;
    at += length;
  }
  return std::nullopt;
}

std::optional<ImageHeader> ExrImageHeader(std::string_view file) {
  const auto exr = ReadExrHeader(file);
  if (!exr) return std::nullopt;
  return ImageHeader{ImageFormat::kExr, exr->width, exr->height,
                     static_cast<int>(exr->channels.size()),
                     exr->channels.front().type == ExrType::kHalf ? 16 : 32};
}

// Width, height and, but for black and white, the greatest value, with blanks and comments between.
std::optional<ImageHeader> PnmHeader(std::string_view file) {
  const char kind = file[1];
  const bool bitmap = kind == '1' || kind == '4';
  std::size_t at = 2;
  std::int64_t numbers[3] = {0, 0, 1};
  for (int i = 0; i < (bitmap ? 2 : 3); ++i) {
    while (at < file.size() &&
           (std::isspace(static_cast<unsigned char>(file[at])) != 0 || file[at] == '#')) {
      at = file[at] == '#' ? std::min(file.find_first_of("\n\r", at), file.size()) : at + 1;
    }
    const std::size_t begin = at;
    for (numbers[i] = 0; at < file.size() && file[at] >= '0' && file[at] <= '9'; ++at) {
      numbers[i] = 10 * numbers[i] + (file[at] - '0');
      if (numbers[i] > std::int64_t{1} << 40U) return std::nullopt;
    }
    if (at == begin) return std::nullopt;
  }
  ImageHeader header{ImageFormat::kPnm, numbers[0], numbers[1], kind == '3' || kind == '6' ? 3 : 1,
                     bitmap ? 1 : (numbers[2] > 255 ? 16 : 8)};
  header.is_stretched = numbers[2] < 255;
  return header;
}

// The first image's directory, of which each tag is there once.
std::optional<ImageHeader> TiffHeader(std::string_view file) {
  HeaderBytes bytes(file);
  const bool little = file[0] == 'I';
  const auto number = [&](std::size_t at, std::size_t size) {
    return little ? bytes.Little(at, size) : bytes.Big(at, size);
  };
  const bool large = number(2, 2) == 43;
  const auto directory = static_cast<std::size_t>(large ? number(8, 8) : number(4, 4));
  const std::size_t count_bytes = large ? 8 : 2;
  const std::size_t entry_bytes = large ? 20 : 12;
  if (!bytes.ok() || directory > file.size()) return std::nullopt;
  const auto count = number(directory, count_bytes);
  if (count > file.size() / entry_bytes) return std::nullopt;
  ImageHeader header{ImageFormat::kTiff, 0, 0, 1, 1};
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::size_t at = directory + count_bytes + entry_bytes * static_cast<std::size_t>(i);
    const auto tag = number(at, 2);
    const auto type = number(at + 2, 2);
    // BYTE, ASCII, SHORT and LONG, and their like; the longer ones are no sides of an image.
    constexpr std::size_t kSizes[] = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 0, 0, 8, 8, 8};
    const std::size_t size = type < std::size(kSizes) ? kSizes[type] : 0;
    // Several values (a channel each) lie elsewhere where they do not fit; one is enough.
    const auto values = number(at + 4, large ? 8 : 4);
    std::size_t value_at = at + (large ? 12 : 8);
    if (values * size > (large ? 8U : 4U)) {
      value_at = static_cast<std::size_t>(number(value_at, large ? 8 : 4));
    }
    if (tag == 256 || tag == 257) {
      std::int64_t& side = tag == 256 ? header.width : header.height;
      const auto value = number(value_at, size);
      if (side != 0 || value > std::uint64_t{1} << 40U) return std::nullopt;
      side = static_cast<std::int64_t>(value);
    } else if (tag == 258) {
      header.bits = static_cast<int>(number(value_at, size) & 0xFFFFU);
    } else if (tag == 277) {
      header.channels = static_cast<int>(number(value_at, size) & 0xFFFFU);
    } else if (tag == 274) {
      header.orientation = static_cast<int>(number(value_at, size) & 0xFFFFU);
    }
  }
  header.is_stretched = header.bits < 8;
  return bytes.ok() ? std::optional(header) : std::nullopt;
}

std::optional<ImageHeader> BmpHeader(std::string_view file) {
  HeaderBytes bytes(file);
  const bool old = bytes.Little(14, 4) == 12;
  const std::size_t side = old ? 2 : 4;
  const auto signed_side = [&](std::size_t at) {
    const auto value = bytes.Little(at, side);
    return old ? static_cast<std::int64_t>(value)
               : std::int64_t{static_cast<std::int32_t>(static_cast<std::uint32_t>(value))};
  };
  const auto bits = static_cast<int>(bytes.Little(old ? 24 : 28, 2));
  // A negative height is an image whose first row is its top.
  const std::int64_t height = signed_side(18 + side);
  const ImageHeader header{ImageFormat::kBmp, signed_side(18), height < 0 ? -height : height,
                           bits == 32 ? 4 : 3, 8};
  return bytes.ok() ? std::optional(header) : std::nullopt;
}

std::optional<ImageHeader> WebpHeader(std::string_view file) {
  HeaderBytes bytes(file);
  const std::string_view chunk = Part(file, 12, 4);
  ImageHeader header{ImageFormat::kWebp, 0, 0, 3, 8};
  if (chunk == "VP8X") {
    header.width = static_cast<std::int64_t>(bytes.Little(24, 3)) + 1;
    header.height = static_cast<std::int64_t>(bytes.Little(27, 3)) + 1;
  } else if (chunk == "VP8L") {
    const auto sides = bytes.Little(21, 4);
    header.width = static_cast<std::int64_t>(sides & 0x3FFFU) + 1;
    header.height = static_cast<std::int64_t>(sides >> 14U & 0x3FFFU) + 1;
  } else if (chunk == "VP8 ") {
    header.width = static_cast<std::int64_t>(bytes.Little(26, 2) & 0x3FFFU);
    header.height = static_cast<std::int64_t>(bytes.Little(28, 2) & 0x3FFFU);
  } else {
    return std::nullopt;
  }
  return bytes.ok() ? std::optional(header) : std::nullopt;
}

std::optional<ImageHeader> HeaderOf(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG\r\n\x1a\n"sv)) return PngHeader(bytes);
  if (bytes.starts_with("\xff\xd8\xff"sv)) return JpegHeader(bytes);
  if (bytes.starts_with("\x76\x2f\x31\x01"sv)) return ExrImageHeader(bytes);
  if (bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6') {
    return PnmHeader(bytes);
  }
  for (const std::string_view begin : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv}) {
    if (bytes.starts_with(begin)) return TiffHeader(bytes);
  }
  if (bytes.starts_with("BM")) return BmpHeader(bytes);
  if (bytes.starts_with("RIFF") && Part(bytes, 8, 4) == "WEBP") {
    return WebpHeader(bytes);
  }
  return std::nullopt;
}

}  // namespace

bool IsWholeJpeg(std::string_view bytes) {
  HeaderBytes file(bytes);
  bool in_scan = false;
  for (std::size_t at = 2; file.ok();) {
    const auto byte = file.Big(at, 1);
    if (byte != 0xFF) {
      if (!in_scan) return false;
      at = bytes.find('\xff', at);
      continue;
    }
    const auto marker = file.Big(at + 1, 1);
    if (marker == 0xFF) {  // filling
      ++at;
      continue;
    }
    at += 2;
    if (marker == 0xD9) return file.ok();
    // A byte 0xFF of the scan's data, a restart in it, or a marker without a length.
    if (marker == 0 || marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8)) continue;
    const auto length = file.Big(at, 2);
    if (length < 2) return false;
    in_scan = marker == 0xDA;
    at += length;
  }
  return false;
}

Expected<ImageHeader> ReadImageHeader(std::string_view bytes, std::string_view where) {
  const auto header = HeaderOf(bytes);
  if (!header || header->width < 1 || header->height < 1) {
    return DataError("{}: cannot be decoded as an image", where);
  }
  TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::image_side, std::max(header->width, header->height),
                                    where, "pixels along a side of the image"));
  TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::image_pixels, header->width * header->height, where,
                                    "pixels in the image"));
  return *header;
}

}  // namespace tsdfpp
