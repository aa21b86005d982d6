#include "mapper/segment/give_way.h"

#include <sched.h>
#include <tbb/global_control.h>

#include <cstddef>

namespace tsdfpp {
namespace {

void KeepToLastCore() {
  cpu_set_t cores;
  if (sched_getaffinity(0, sizeof cores, &cores) != 0) return;
  const std::size_t threads =
      tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  if (threads < static_cast<std::size_t>(CPU_COUNT(&cores))) return;
  std::size_t last = CPU_SETSIZE - 1;
  while (last > 0 && !CPU_ISSET(last, &cores)) --last;
  CPU_ZERO(&cores);
  CPU_SET(last, &cores);
  sched_setaffinity(0, sizeof cores, &cores);
}

}  // namespace

void GiveWay() {
  // Linux has a policy for each thread; that of 0 is the one that calls.
  const sched_param none{};
  sched_setscheduler(0, SCHED_IDLE, &none);
  KeepToLastCore();
}

}  // namespace tsdfpp
