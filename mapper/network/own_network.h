// The file of our own network, within the program.
#pragma once

#include <span>

namespace tsdfpp {

// mapper/network/segmenter.onnx, which tools/segmenter makes.
std::span<const unsigned char> OwnNetworkFile();

}  // namespace tsdfpp
