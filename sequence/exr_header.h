// The channel list of an OpenEXR file, which OpenCV does not show: it turns integers into floats
// and reads channels that it does not know as zeros.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tsdfpp {

enum class ExrType { kInteger = 0, kHalf = 1, kFloat = 2 };

struct ExrChannel {
  std::string name;
  ExrType type = ExrType::kFloat;
};

// The channels in the file's order; none where `bytes` does not begin with a readable EXR header
// (openexr.com, "OpenEXR File Layout").
std::vector<ExrChannel> ExrChannels(std::string_view bytes);

}  // namespace tsdfpp
