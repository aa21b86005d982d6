// Ctrl-C and `kill` end a command in good order.
#pragma once

#include <array>
#include <atomic>
#include <csignal>

#include "core/error.h"

namespace tsdfpp {

// While this lives, the first SIGINT or SIGTERM asks to stop, and the second one ends the process.
// One that was ignored before stays so.
class StopOnSignal {
 public:
  StopOnSignal();
  ~StopOnSignal();
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

  // Set once a signal came.
  static const std::atomic<bool>& stop();
  // Prints the error and ends the process by the signal that came: to whoever waits for it, it died
  // as it would have without a handler. Call it when none lives.
  static void Die(const Error& error);

 private:
  static constexpr std::array kSignals{SIGINT, SIGTERM};
  std::array<struct sigaction, kSignals.size()> before_{};  // what was done at each
};

}  // namespace tsdfpp
