#include "mapper/map_config.h"

#include <cmath>

#include "core/setting_order.h"

namespace tsdfpp {
namespace {

Expected<void> InRange(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("map setting '{}' is {}, expected {} to {}", field, value, lowest, highest);
}

}  // namespace

std::string_view DistancesName(Distances distances) {
  switch (distances) {
    case Distances::kRay:
      return "ray";
    case Distances::kSurface:
      return "surface";
  }
  std::abort();
}

Expected<Distances> DistancesFromName(std::string_view name) {
  for (const Distances distances : {Distances::kRay, Distances::kSurface}) {
    if (name == DistancesName(distances)) return distances;
  }
  return UsageError("distances '{}' is unknown, expected ray or surface", name);
}

std::string_view ResamplingName(Resampling resampling) {
  switch (resampling) {
    case Resampling::kAll:
      return "all";
    case Resampling::kObserved:
      return "observed";
    case Resampling::kNearest:
      return "nearest";
  }
  std::abort();
}

Expected<Resampling> ResamplingFromName(std::string_view name) {
  for (const Resampling resampling :
       {Resampling::kAll, Resampling::kObserved, Resampling::kNearest}) {
    if (name == ResamplingName(resampling)) return resampling;
  }
  return UsageError("resampling '{}' is unknown, expected all, observed or nearest", name);
}

std::string_view RemovedVoxelsName(RemovedVoxels removed) {
  switch (removed) {
    case RemovedVoxels::kFree:
      return "free";
    case RemovedVoxels::kUnobserved:
      return "unobserved";
  }
  std::abort();
}

Expected<RemovedVoxels> RemovedVoxelsFromName(std::string_view name) {
  for (const RemovedVoxels removed : {RemovedVoxels::kFree, RemovedVoxels::kUnobserved}) {
    if (name == RemovedVoxelsName(removed)) return removed;
  }
  return UsageError("removed_voxels '{}' is unknown, expected free or unobserved", name);
}

std::string_view MovedVoxelsName(MovedVoxels moved) {
  switch (moved) {
    case MovedVoxels::kAll:
      return "all";
    case MovedVoxels::kNearSurface:
      return "near_surface";
  }
  std::abort();
}

Expected<MovedVoxels> MovedVoxelsFromName(std::string_view name) {
  for (const MovedVoxels moved : {MovedVoxels::kAll, MovedVoxels::kNearSurface}) {
    if (name == MovedVoxelsName(moved)) return moved;
  }
  return UsageError("moved_voxels '{}' is unknown, expected all or near_surface", name);
}

Expected<void> MapConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(InRange("voxel_m", voxel_m, kSmallestVoxel_m, kLargestVoxel_m));
  TSDFPP_RETURN_IF_ERROR(InRange("trunc_front_voxels", trunc_front_voxels, 1, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("trunc_back_voxels", trunc_back_voxels, 1, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("vote_band_voxels", vote_band_voxels, 1, 100));
  TSDFPP_RETURN_IF_ERROR(InRange("layers", layers, 0, kMaxLayers));
  TSDFPP_RETURN_IF_ERROR(InRange("weight_cap", weight_cap, 1, 255));
  TSDFPP_RETURN_IF_ERROR(InRange("confidence_cap", confidence_cap, 1, kMostConfidence));
  TSDFPP_RETURN_IF_ERROR(InRange("moved_confidence", moved_confidence, 1, kMostConfidence));
  TSDFPP_RETURN_IF_ERROR(
      CheckOrder("map", "moved_confidence", moved_confidence, "confidence_cap", confidence_cap));
  return {};
}

Expected<void> MapConfig::SetProfile(std::string_view profile) {
  if (profile != "paper" && profile != "close") {
    return UsageError("profile '{}' is unknown, expected paper or close", profile);
  }
  trunc_front_voxels = 10;
  trunc_back_voxels = profile == "paper" ? 10 : 3;
  return {};
}

Expected<MapConfig> MapConfig::FromToml(const toml::table& table, const std::string& where) {
  MapConfig config;
  std::string distances(DistancesName(config.distances));
  std::string resampling(ResamplingName(config.resampling));
  std::string moved_voxels(MovedVoxelsName(config.moved_voxels));
  std::string removed_voxels(RemovedVoxelsName(config.removed_voxels));
  TomlReader reader(table, where);
  reader.Get("voxel_m", config.voxel_m)
      .Get("trunc_front_voxels", config.trunc_front_voxels)
      .Get("trunc_back_voxels", config.trunc_back_voxels)
      .Get("layers", config.layers)
      .Get("weight_cap", config.weight_cap)
      .Get("confidence_cap", config.confidence_cap)
      .Get("moved_confidence", config.moved_confidence)
      .Get("contradiction", config.contradiction)
      .Get("rims", config.rims)
      .Get("relist_on_removal", config.relist_on_removal)
      .Get("colour_whole_band", config.colour_whole_band)
      .Get("distances", distances)
      .Get("resampling", resampling)
      .Get("moved_voxels", moved_voxels)
      .Get("removed_voxels", removed_voxels)
      .Get("vote_band_voxels", config.vote_band_voxels);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  const Expected<Distances> measured = DistancesFromName(distances);
  if (!measured) return UsageError("{}: {}", where, measured.error().message);
  config.distances = *measured;
  const Expected<Resampling> named = ResamplingFromName(resampling);
  if (!named) return UsageError("{}: {}", where, named.error().message);
  config.resampling = *named;
  const Expected<MovedVoxels> moved = MovedVoxelsFromName(moved_voxels);
  if (!moved) return UsageError("{}: {}", where, moved.error().message);
  config.moved_voxels = *moved;
  const Expected<RemovedVoxels> removed = RemovedVoxelsFromName(removed_voxels);
  if (!removed) return UsageError("{}: {}", where, removed.error().message);
  config.removed_voxels = *removed;
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table MapConfig::ToToml() const {
  return toml::table{{"voxel_m", voxel_m},
                     {"trunc_front_voxels", trunc_front_voxels},
                     {"trunc_back_voxels", trunc_back_voxels},
                     {"layers", layers},
                     {"weight_cap", weight_cap},
                     {"confidence_cap", confidence_cap},
                     {"moved_confidence", moved_confidence},
                     {"contradiction", contradiction},
                     {"rims", rims},
                     {"relist_on_removal", relist_on_removal},
                     {"colour_whole_band", colour_whole_band},
                     {"distances", DistancesName(distances)},
                     {"resampling", ResamplingName(resampling)},
                     {"moved_voxels", MovedVoxelsName(moved_voxels)},
                     {"removed_voxels", RemovedVoxelsName(removed_voxels)},
                     {"vote_band_voxels", vote_band_voxels}};
}

int LayersOf(Method method, const MapConfig& config) {
  const MethodInfo& info = InfoOf(method);
  return info.layers_can_be_set && config.layers != 0 ? config.layers : info.layers;
}

}  // namespace tsdfpp
