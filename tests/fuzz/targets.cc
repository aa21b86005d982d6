#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/limits.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

// Some builds have all but the target of saved maps (0), or that one alone (1).
#ifdef TSDFPP_FUZZ_MAPS
constexpr bool kMaps = TSDFPP_FUZZ_MAPS == 1;
constexpr bool kOthers = !kMaps;
#else
constexpr bool kMaps = true;
constexpr bool kOthers = true;
#endif

}  // namespace

const std::vector<Target>& AllTargets() {
  static const std::vector<Target> targets = [] {
    std::vector<Target> all;
    if constexpr (kMaps) AddMapTargets(all);
    if constexpr (kOthers) {
      AddSequenceTargets(all);
      AddMeshTargets(all);
      AddConfigTargets(all);
      AddResultTargets(all);
      AddTextTargets(all);
    }
    std::sort(all.begin(), all.end(),
              [](const Target& a, const Target& b) { return a.name < b.name; });
    return all;
  }();
  return targets;
}

const Target* FindTarget(std::string_view name) {
  const std::vector<Target>& all = AllTargets();
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const Target& target) { return target.name == name; });
  return found == all.end() ? nullptr : &*found;
}

void PrepareTargets() {
  spdlog::set_level(spdlog::level::off);
  Limits limits;
  limits.file_bytes = 1 << 20;
  limits.text_bytes = 1 << 18;
  limits.json_bytes = 1 << 18;
  limits.image_side = 512;
  limits.image_pixels = 1 << 16;
  limits.frames = 1000;
  limits.map_bytes = 4 << 20;
  limits.mesh_elements = 100'000;
  SetLimits(limits);
}

}  // namespace tsdfpp::fuzz
