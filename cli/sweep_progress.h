// What the commands that run experiments share on a terminal.
#pragma once

#include <algorithm>
#include <string>
#include <thread>

#include "cli/command.h"
#include "cli/stop_on_signal.h"
#include "eval/sweep/sweep.h"

namespace tsdfpp {

// `asked` worker processes, or one a core where 0.
inline int JobsOrCores(int asked) {
  return asked > 0 ? asked : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

// What `work`, a function that gives an Expected, gives; it runs experiments with `sweep`, which
// gets a bar for the frames that are mapped and stops at SIGINT or SIGTERM. Such a signal ends the
// process by itself, once `work` has left things in order.
template <typename Work>
auto WithSweepBar(const std::string& title, SweepOptions& sweep, const Work& work) {
  decltype(work()) result;
  {
    const StopOnSignal handler;
    ProgressBar bar(title);
    sweep.stop = &StopOnSignal::stop();
    sweep.progress = [&](int done, int total) { bar.Show(done, total); };
    result = work();
    sweep.progress = nullptr;
  }
  if (!result && StopOnSignal::stop()) StopOnSignal::Die(result.error());
  return result;
}

}  // namespace tsdfpp
