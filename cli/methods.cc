#include <fmt/format.h>

#include "cli/command.h"
#include "mapper/method_info.h"

namespace tsdfpp {

Run AddMethods(CLI::App&, const CommonOptions&) {
  return []() -> Expected<CommandResult> {
    CommandResult result{nlohmann::json::array(), ""};
    for (const MethodInfo& info : Methods()) {
      result.json.push_back({{"name", info.name},
                             {"help", info.help},
                             {"layers", info.layers},
                             {"layers_can_be_set", info.layers_can_be_set},
                             {"one_field", info.one_field},
                             {"moves_values", info.moves_values},
                             {"has_voxels", info.has_voxels},
                             {"on_light", info.on_light},
                             {"on_dark", info.on_dark}});
      result.text += fmt::format("{:<16} {}\n", info.name, info.help);
    }
    return result;
  };
}

}  // namespace tsdfpp
