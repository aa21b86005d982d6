// The settings of the repair of masks (mapper/associate/mask_repair.h).
#pragma once

#include <string>
#include <string_view>

#include "core/error.h"
#include "core/toml_reader.h"
#include "mapper/method_info.h"

namespace tsdfpp {

// Whether masks are repaired before they are fused.
enum class MaskRepairMode {
  kOff,  // labels are fused as they were associated
  kOn,
};

// "off" or "on". Errors: kUsage.
Expected<MaskRepairMode> MaskRepairModeFromName(std::string_view name);
std::string_view MaskRepairModeName(MaskRepairMode mode);

// Errors: kUsage where masks are to be repaired by a map that has no voxels to ask.
Expected<void> CheckMaskRepair(Method method, MaskRepairMode mode);

struct MaskRepairConfig {
  double keep_voxels = 1;     // a surface so near to a point explains it, if it is its label's own
  double take_voxels = 0.5;   // or if it is another object's
  double sigma_voxels = 0.4;  // standard deviation of a point about its own surface
  double own_factor = 8;      // how much likelier the label is than another object, before the map
  double cell_voxels = 2;     // new surface is counted in cells of this side
  int confirm_frames = 4;     // and fused where a label was seen in a cell in so many frames
  int forget_frames = 30;     // a cell that no frame showed for longer counts from 0 again

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Reads one table strictly; `where` names the file in errors.
  static Expected<MaskRepairConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const MaskRepairConfig&) const = default;
};

}  // namespace tsdfpp
