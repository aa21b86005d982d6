// What an image file says about itself, read from its first bytes, before its pixels are.
#pragma once

#include <cstdint>
#include <string_view>

#include "core/error.h"

namespace tsdfpp {

enum class ImageFormat { kPng, kJpeg, kExr, kPnm, kTiff, kBmp, kWebp };

struct ImageHeader {
  ImageFormat format = ImageFormat::kPng;
  std::int64_t width = 0;  // pixels, 1 or more
  std::int64_t height = 0;
  int channels = 0;  // as stored: a palette's is 3
  int bits = 0;      // of a channel
  // How TIFF's tag 274 says that it is to be turned or mirrored: 1 as it is stored, 2 to 8
  // otherwise.
  int orientation = 1;
  // Decoders stretch its values to 0 to 255: grey of less than 8 bits, PNM of a lower greatest
  // value.
  bool is_stretched = false;
};

// Whether a JPEG's segments and scans go on to its end-of-image marker. Decoders fill up what a cut
// one lacks, and say nothing.
bool IsWholeJpeg(std::string_view bytes);

// By the bytes, not by the file's name. `where` begins the sentence. Errors: kData where the format
// is none of these, the header is cut short or says something that cannot be, and where the size is
// over the limits image_side or image_pixels.
Expected<ImageHeader> ReadImageHeader(std::string_view bytes, std::string_view where);

}  // namespace tsdfpp
