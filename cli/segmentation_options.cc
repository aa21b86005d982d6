#include "cli/segmentation_options.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>

#include "cli/command.h"
#include "eval/run/mask_folder.h"
#include "mapper/instance_network.h"

namespace tsdfpp {
namespace {

Expected<std::shared_ptr<InstanceFinder>> FinderOf(const SegmentationOptions& options,
                                                   const NetworkConfig& config) {
  if (!options.masks.empty()) {
    if (!options.model.empty())
      return UsageError("--masks and --model are both given, expected one");
    TSDFPP_ASSIGN(std::shared_ptr<InstanceFinder> masks, MaskFolder::Open(options.masks));
    return masks;
  }
  if (options.model.empty()) {
    TSDFPP_ASSIGN(std::shared_ptr<InstanceFinder> own, OwnInstanceNetwork(config));
    return own;
  }
  TSDFPP_ASSIGN(std::shared_ptr<InstanceFinder> loaded, LoadInstanceNetwork(options.model, config));
  return loaded;
}

constexpr std::array kOfFull{"latency",  "gives_way",  "join_overlap",
                             "join_iou", "mask_score", "unknown_objects"};

bool IsOfFull(std::string_view key) {
  return std::find(kOfFull.begin(), kOfFull.end(), key) != kOfFull.end();
}

// Those that are of no use: of joining where nothing is joined, and of finding masks that are there
// already.
Expected<void> CheckSettings(const toml::table& settings, const std::string& where, bool is_full,
                             bool is_of_masks) {
  for (const auto& [key, value] : settings) {
    if (!is_full && IsOfFull(key.str())) {
      return UsageError("{}: '{}' is a setting of --segmentation full", where, key.str());
    }
    if (!is_of_masks || key.str() == "every" || IsOfFull(key.str())) continue;
    return UsageError("{}: '{}' is a setting of networks, expected with --masks: every, {}", where,
                      key.str(), fmt::join(kOfFull, ", "));
  }
  return {};
}

}  // namespace

std::string SegmentationOptions::Text() const {
  std::string text;
  for (const auto& [name, value] : {std::pair{"--segmentation-config", depth_config},
                                    {"--model", model},
                                    {"--masks", masks},
                                    {"--network-config", network_config}}) {
    if (!value.empty()) text += fmt::format(" {} {}", name, value);
  }
  return text;
}

std::vector<std::filesystem::path> SegmentationOptions::Places() const {
  std::vector<std::filesystem::path> places{depth_config, model, masks, network_config};
  // The graph of a .pb: beside it, or where the settings say.
  if (!model.empty()) places.push_back(std::filesystem::path(model).replace_extension(".pbtxt"));
  if (network_config.empty()) return places;
  const auto table = ParseTomlFile(network_config);
  if (!table) return places;  // which is said where it is read
  if (const auto network = NetworkConfig::FromToml(*table, network_config)) {
    places.emplace_back(network->graph);
  }
  return places;
}

void AddSegmentationOptions(CLI::App& app, const std::string& help, SegmentationOptions& options) {
  auto* const segmentation =
      app.add_option("--segmentation", options.segmentation,
                     help +
                         " depth (convex parts of the depth image), network (things that a network "
                         "finds) or full (both, joined), whose segments are associated by votes "
                         "(docs/segmentation.md)")
          ->check(OneOf({"gt", "none", "depth", "network", "full"}));
  if (!options.segmentation.empty()) segmentation->capture_default_str();
  app.add_option("--model", options.model,
                 "Of network and full: the network, .onnx (of our own, or YOLO's for segments) or "
                 ".pb with its .pbtxt (TensorFlow's Mask R-CNN); by default our own, which is part "
                 "of the program")
      ->check(NotEmpty("a file"));
  app.add_option("--masks", options.masks,
                 "Of network and full, in place of a network: a folder of masks that any network "
                 "wrote, an image of ids a frame (000012.png) or one an instance "
                 "(000012_000003.png, 12/3.png)")
      ->check(NotEmpty("a folder"));
  app.add_option("--network-config", options.network_config,
                 "Of network and full: settings, TOML (docs/segmentation.md)")
      ->check(NotEmpty("a file"));
}

void AddDepthConfigOption(CLI::App& app, SegmentationOptions& options) {
  app.add_option("--segmentation-config", options.depth_config,
                 "Settings of --segmentation depth and full, TOML (docs/segmentation.md)")
      ->check(NotEmpty("a file"));
}

Expected<SegmenterParts> ReadSegmenterParts(const SegmentationOptions& options,
                                            std::optional<Segmentation> segmentation) {
  SegmenterParts parts;
  const bool uses_depth = segmentation && UsesDepth(*segmentation);
  const bool uses_network = segmentation && UsesNetwork(*segmentation);
  if (!options.depth_config.empty()) {
    if (!uses_depth) {
      return UsageError("--segmentation-config needs --segmentation depth or full");
    }
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.depth_config));
    TSDFPP_ASSIGN(parts.depth, DepthSegmentsConfig::FromToml(table, options.depth_config));
  }
  if (!uses_network) {
    for (const auto& [name, value] : {std::pair{"--model", options.model},
                                      {"--masks", options.masks},
                                      {"--network-config", options.network_config}}) {
      if (!value.empty()) return UsageError("{} needs --segmentation network or full", name);
    }
    return parts;
  }
  if (!options.network_config.empty()) {
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.network_config));
    TSDFPP_ASSIGN(parts.network, NetworkConfig::FromToml(table, options.network_config));
    TSDFPP_RETURN_IF_ERROR(
        CheckSettings(table, options.network_config, uses_depth, !options.masks.empty()));
  }
  TSDFPP_ASSIGN(parts.finder, FinderOf(options, parts.network));
  return parts;
}

}  // namespace tsdfpp
