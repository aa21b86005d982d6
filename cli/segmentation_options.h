// The options of map, compare and segment that say how frames are segmented.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/segment/segmenter.h"

namespace tsdfpp {

struct SegmentationOptions {
  std::string segmentation{};  // may be empty: nobody said
  std::string depth_config{};  // files; may be empty
  std::string model{};
  std::string masks{};  // a folder; may be empty
  std::string network_config{};

  // The options that were given, as on a command line, each with a space before; `--segmentation`
  // aside.
  std::string Text() const;
  // What they are read from: files, and the masks' folder.
  std::vector<std::filesystem::path> Places() const;
};

// --segmentation, with `help` before the names of those that find segments; its default is what
// `options` holds. --model, --masks and --network-config.
void AddSegmentationOptions(CLI::App& app, const std::string& help, SegmentationOptions& options);
// --segmentation-config.
void AddDepthConfigOption(CLI::App& app, SegmentationOptions& options);

// The parts of that segmentation, with the network loaded: --model's, the masks of --masks, or our
// own. Errors: kUsage where an option does not go with the segmentation, and for what its files
// say; kData for a network.
Expected<SegmenterParts> ReadSegmenterParts(const SegmentationOptions& options,
                                            std::optional<Segmentation> segmentation);

}  // namespace tsdfpp
