#include "bench/figures.h"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cstdio>

#include "core/files.h"

namespace tsdfpp {

Expected<void> RunFigures(const FigureOptions& options) {
  struct Part {
    const char* name;
    Expected<void> (*measure)(const FigureOptions&);
  };
  constexpr std::array<Part, 6> kParts{{{"decay", MeasureDecay},
                                        {"layers", MeasureLayers},
                                        {"switches", MeasureSwitches},
                                        {"sweep", MeasureSweep},
                                        {"slice", MeasureSlice},
                                        {"ghosts", MeasureGhosts}}};
  for (const std::string& wanted : options.parts) {
    const auto is_wanted = [&](const Part& part) { return part.name == wanted; };
    if (std::none_of(kParts.begin(), kParts.end(), is_wanted)) {
      return UsageError(
          "--parts has '{}', expected some of decay, layers, switches, sweep, slice and ghosts",
          wanted);
    }
  }
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(options.out));
  for (const Part& part : kParts) {
    if (std::find(options.parts.begin(), options.parts.end(), part.name) == options.parts.end()) {
      continue;
    }
    const auto start = std::chrono::steady_clock::now();
    TSDFPP_RETURN_IF_ERROR(part.measure(options));
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    fmt::print("{}: {}/{}.csv ({:.0f} s)\n", part.name, options.out, part.name, seconds);
    std::fflush(stdout);
  }
  return {};
}

}  // namespace tsdfpp
