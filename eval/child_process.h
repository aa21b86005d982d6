// Runs somebody else's program under limits: its output in a log, nothing of it left behind.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct ChildLimits {
  double time_s = 600;                        // wall clock
  std::int64_t memory_bytes = 4'000'000'000;  // resident, of the program and all that it starts
};

struct ChildOutcome {
  double wall_s = 0;
  double cpu_s = 0;              // user and system, of the program and what it waited for
  std::int64_t peak_bytes = 0;   // resident memory at its greatest, looked at every kMemoryLook_s
  std::optional<Error> failure;  // kEnvironment: it could not be run; kData: all else
};

inline constexpr double kMemoryLook_s = 0.05;

// Runs words[0] (found along PATH) with the other words as arguments, in the folder `at`, without
// input; stdout and stderr go to the file `log`. The program has a process group of its own, all of
// which is killed where a limit is passed, when the program ends, or (the program alone) when we
// die. A program that needs more memory than the limit for less than kMemoryLook_s may get it.
// Failures are sentences that begin with `name` and, where the program said anything, end with the
// end of its log.
ChildOutcome RunChildProcess(const std::string& name, const std::vector<std::string>& words,
                             const std::filesystem::path& at, const std::filesystem::path& log,
                             const ChildLimits& limits);

}  // namespace tsdfpp
