#include "mapper/segment/network_config.h"

#include <cmath>
#include <cstdlib>

#include "core/plain_name.h"
#include "core/setting_order.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kMostClasses = 10'000;

Expected<void> CheckNetwork(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("network setting '{}' is {}, expected {} to {}", field, value, lowest, highest);
}

}  // namespace

Expected<NetworkFormat> NetworkFormatFromName(std::string_view name) {
  if (name == "auto") return NetworkFormat::kAuto;
  if (name == "centres") return NetworkFormat::kCentres;
  if (name == "yolo") return NetworkFormat::kYolo;
  if (name == "mask_rcnn") return NetworkFormat::kMaskRcnn;
  return UsageError("network format '{}' is unknown, expected auto, centres, yolo or mask_rcnn",
                    name);
}

std::string_view NetworkFormatName(NetworkFormat format) {
  switch (format) {
    case NetworkFormat::kAuto:
      return "auto";
    case NetworkFormat::kCentres:
      return "centres";
    case NetworkFormat::kYolo:
      return "yolo";
    case NetworkFormat::kMaskRcnn:
      return "mask_rcnn";
  }
  std::abort();
}

Expected<void> NetworkConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("width", width, 0, kMostNetworkSide_px));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("height", height, 0, kMostNetworkSide_px));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("least_score", least_score, 0, 1));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("most_overlap", most_overlap, 0, 1));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("mask_share", mask_share, 0, 1));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("every", every, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("latency", latency, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckOrder("network", "latency", latency, "every", every));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("join_overlap", join_overlap, 0.5, 1));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("join_iou", join_iou, 0.5, 1));
  TSDFPP_RETURN_IF_ERROR(CheckNetwork("mask_score", mask_score, 0, 1));
  if (gives_way && latency == 0) {
    return UsageError(
        "network setting 'gives_way' is true, but 'latency' is 0: the frames wait for the network");
  }
  if (classes.size() > kMostClasses) {
    return UsageError("network setting 'classes' has {} names, expected {} at most", classes.size(),
                      kMostClasses);
  }
  for (const std::string& name : classes) {
    if (name.empty()) return UsageError("network setting 'classes' has an empty name");
    const auto is_label = CheckLabel(name, "network setting 'classes'");
    if (!is_label) return UsageError("{}", is_label.error().message);
  }
  return {};
}

Expected<NetworkConfig> NetworkConfig::FromToml(const toml::table& table,
                                                const std::string& where) {
  NetworkConfig config;
  std::string format(NetworkFormatName(config.format));
  TomlReader reader(table, where);
  reader.Get("format", format)
      .Get("classes", config.classes)
      .Get("graph", config.graph)
      .Get("width", config.width)
      .Get("height", config.height)
      .Get("least_score", config.least_score)
      .Get("most_overlap", config.most_overlap)
      .Get("mask_share", config.mask_share)
      .Get("every", config.every)
      .Get("latency", config.latency)
      .Get("gives_way", config.gives_way)
      .Get("join_overlap", config.join_overlap)
      .Get("join_iou", config.join_iou)
      .Get("mask_score", config.mask_score)
      .Get("unknown_objects", config.unknown_objects);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  const Expected<NetworkFormat> named = NetworkFormatFromName(format);
  if (!named) return UsageError("{}: {}", where, named.error().message);
  config.format = *named;
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table NetworkConfig::ToToml() const {
  toml::array names;
  for (const std::string& name : classes) names.push_back(name);
  return toml::table{{"format", NetworkFormatName(format)},
                     {"classes", names},
                     {"graph", graph},
                     {"width", width},
                     {"height", height},
                     {"least_score", least_score},
                     {"most_overlap", most_overlap},
                     {"mask_share", mask_share},
                     {"every", every},
                     {"latency", latency},
                     {"gives_way", gives_way},
                     {"join_overlap", join_overlap},
                     {"join_iou", join_iou},
                     {"mask_score", mask_score},
                     {"unknown_objects", unknown_objects}};
}

}  // namespace tsdfpp
