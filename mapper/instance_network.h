// A network that finds instances in frames, run by OpenCV on the processor (paper III-B has Mask
// R-CNN there; docs/segmentation.md, "Networks").
#pragma once

#include <filesystem>
#include <memory>

#include "core/error.h"
#include "mapper/segment/instance_finder.h"
#include "mapper/segment/network_config.h"

namespace tsdfpp {

// Reads a network: ONNX (.onnx) of our own or of YOLO's heads, or TensorFlow's frozen Mask R-CNN
// (.pb, with its .pbtxt). Each frame is found by itself; the same bytes for any number of threads.
// The files are read by OpenCV, which checks less than we do: take them from whom you trust.
// Errors: kData, naming the file and, where OpenCV does, the layer; kUsage where the config's
// format is not the file's, or it sets something that the format has no use for.
Expected<std::unique_ptr<InstanceFinder>> LoadInstanceNetwork(const std::filesystem::path& file,
                                                              const NetworkConfig& config);

// The network that tools/segmenter trained, which is part of the program.
Expected<std::unique_ptr<InstanceFinder>> OwnInstanceNetwork(const NetworkConfig& config);

}  // namespace tsdfpp
