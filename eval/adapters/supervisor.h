// The process between us and somebody else's program: it sees to it that nothing of the program
// stays, even where we are killed.
#pragma once

#include <sys/types.h>

#include <cstdint>

#include "eval/adapters/process_tree.h"

namespace tsdfpp {

// Why a program was ended before its time.
enum class EndedFor : std::uint8_t { kNothing, kTime, kMemory, kProcesses, kOrder };

// What to run and how far it may go. Descriptors are -1 where there are none.
struct SupervisedProgram {
  char* const* words = nullptr;  // found along PATH
  const char* at = nullptr;      // the folder to run it in
  int input = -1;
  int output = -1;   // stdout and stderr
  int control = -1;  // of a pipe: a byte, or its other end closed, means that all is to end
  int report = -1;   // of a pipe: gets one SupervisorReport
  int enter_group = -1;
  int end_group = -1;  // eval/adapters/control_group.h
  const char* group = nullptr;
  double time_s = 0;
  std::int64_t memory_bytes = 0;
  std::int64_t processes = 0;
  std::int64_t file_bytes = 0;
};

struct SupervisorReport {
  int exec_failure = 0;  // errno: it could not be run
  int status = 0;        // of wait(2), where it ended by itself
  EndedFor ended_for = EndedFor::kNothing;
  bool all_ended = false;
  double wall_s = 0;
  double cpu_s = 0;             // of all that it started
  std::int64_t peak_bytes = 0;  // of all at once, at the looks
  std::int64_t most_bytes =
      0;  // of one of them at its greatest, but what we had at the fork counts
  std::int64_t most_processes = 0;
};

inline constexpr double kLook_s = 0.05;

// To be called in a child of ours, after the fork. It is the subreaper of all that the program
// starts, looks at them every kLook_s, and ends them all when the program ends, passes a limit,
// when it is told so or when its parent dies; it dumps no core. Nothing here allocates or takes a
// lock, as is fit for the child of a process with many threads.
[[noreturn]] void Supervise(const SupervisedProgram& program, pid_t parent, ProcessTree& tree);

}  // namespace tsdfpp
