// The header of an OpenEXR file, which OpenCV does not show: it turns integers into floats and
// reads channels that it does not know as zeros.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tsdfpp {

enum class ExrType { kInteger = 0, kHalf = 1, kFloat = 2 };

struct ExrChannel {
  std::string name;
  ExrType type = ExrType::kFloat;
  bool has_all_pixels = true;  // its sampling rates are 1
};

struct ExrHeader {
  std::vector<ExrChannel> channels;  // in the file's order
  std::int64_t width = 0;            // of the data window
  std::int64_t height = 0;
};

// Nothing where `bytes` does not begin with a readable EXR header (openexr.com, "OpenEXR File
// Layout") that has channels and a data window once each.
std::optional<ExrHeader> ReadExrHeader(std::string_view bytes);

}  // namespace tsdfpp
