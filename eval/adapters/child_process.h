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
  std::int64_t processes = 500;               // at once, of the program and all that it starts
  std::int64_t log_bytes = 10'000'000;        // what is kept of its output, half of it the end
  std::int64_t disk_bytes = 8'000'000'000;    // in the folder it runs in; of any file anywhere
  bool control_group = true;                  // use one where it may be made
};

struct ChildOutcome {
  double wall_s = 0;
  double cpu_s = 0;                 // user and system, of the program and all that it started
  std::int64_t peak_bytes = 0;      // resident memory at its greatest, looked at every kLook_s
  std::int64_t most_processes = 0;  // at once, likewise
  std::int64_t log_bytes = 0;       // that it wrote; what is kept of them may be less
  std::optional<Error> failure;     // kEnvironment: it could not be run; kData: all else
};

// Runs words[0] (found along PATH) with the other words as arguments, in the folder `at`, without
// input; stdout and stderr go to the file `log`. When the program ends or passes a limit, or when
// we die, all that it started is ended with it, whatever process group or session that is in: a
// process between us and the program, which adopts its orphans, sees to it
// (eval/adapters/supervisor.h), with a control group of the kernel where we may make one. A program
// that passes a limit for less than a look may get away with it. Failures are sentences that begin
// with `name` and, where the program said anything, end with the end of its log, which they call
// `shown_log`.
ChildOutcome RunChildProcess(const std::string& name, const std::vector<std::string>& words,
                             const std::filesystem::path& at, const std::filesystem::path& log,
                             const ChildLimits& limits,
                             const std::filesystem::path& shown_log = {});

// How the children of adapters are found and ended on this machine, for people.
std::string ChildControl();

}  // namespace tsdfpp
