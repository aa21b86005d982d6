#include "mapper/associate/mask_repair_config.h"

#include <cmath>
#include <cstdlib>

#include "core/setting_order.h"

namespace tsdfpp {
namespace {

Expected<void> CheckRepair(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("mask repair setting '{}' is {}, expected {} to {}", field, value, lowest,
                    highest);
}

}  // namespace

Expected<MaskRepairMode> MaskRepairModeFromName(std::string_view name) {
  if (name == "off") return MaskRepairMode::kOff;
  if (name == "on") return MaskRepairMode::kOn;
  return UsageError("mask repair '{}' is unknown, expected off or on", name);
}

std::string_view MaskRepairModeName(MaskRepairMode mode) {
  switch (mode) {
    case MaskRepairMode::kOff:
      return "off";
    case MaskRepairMode::kOn:
      return "on";
  }
  std::abort();
}

Expected<void> CheckMaskRepair(Method method, MaskRepairMode mode) {
  if (mode == MaskRepairMode::kOff || InfoOf(method).has_voxels) return {};
  return UsageError(
      "the repair of masks asks a map for its voxels, which method '{}' has not, expected off",
      MethodName(method));
}

Expected<void> MaskRepairConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(CheckRepair("keep_voxels", keep_voxels, 0.01, 100));
  TSDFPP_RETURN_IF_ERROR(CheckRepair("take_voxels", take_voxels, 0, 100));
  TSDFPP_RETURN_IF_ERROR(
      CheckOrder("mask repair", "take_voxels", take_voxels, "keep_voxels", keep_voxels));
  TSDFPP_RETURN_IF_ERROR(CheckRepair("sigma_voxels", sigma_voxels, 0.01, 100));
  TSDFPP_RETURN_IF_ERROR(CheckRepair("own_factor", own_factor, 1, 1e6));
  TSDFPP_RETURN_IF_ERROR(CheckRepair("cell_voxels", cell_voxels, 1, 100));
  TSDFPP_RETURN_IF_ERROR(CheckRepair("confirm_frames", confirm_frames, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckRepair("forget_frames", forget_frames, 1, 1'000'000));
  return {};
}

Expected<MaskRepairConfig> MaskRepairConfig::FromToml(const toml::table& table,
                                                      const std::string& where) {
  MaskRepairConfig config;
  TomlReader reader(table, where);
  reader.Get("keep_voxels", config.keep_voxels)
      .Get("take_voxels", config.take_voxels)
      .Get("sigma_voxels", config.sigma_voxels)
      .Get("own_factor", config.own_factor)
      .Get("cell_voxels", config.cell_voxels)
      .Get("confirm_frames", config.confirm_frames)
      .Get("forget_frames", config.forget_frames);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table MaskRepairConfig::ToToml() const {
  return toml::table{{"keep_voxels", keep_voxels},    {"take_voxels", take_voxels},
                     {"sigma_voxels", sigma_voxels},  {"own_factor", own_factor},
                     {"cell_voxels", cell_voxels},    {"confirm_frames", confirm_frames},
                     {"forget_frames", forget_frames}};
}

}  // namespace tsdfpp
