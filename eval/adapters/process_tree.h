// The processes that a process has started, and all that those have started, found through /proc.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <span>
#include <vector>

namespace tsdfpp {

struct TreeProcess {
  pid_t id = 0;
  pid_t parent = 0;
  char state = ' ';  // proc(5): R, S, D, T, t, Z, X, ...
  std::int64_t resident_pages = 0;
  bool below = false;  // the root is its parent, or its parent's parent, ...
};

// Looks allocate nothing, so that a child of a process with many threads can take them between fork
// and exec. A process that is started or loses its parent while one looks may be missed; the next
// look finds it. Where the root is a subreaper (prctl(2)), orphans become its children, and so
// nobody leaves the tree by ending his parent, nor by setsid.
class ProcessTree {
 public:
  // Sees so many processes of the machine at most.
  explicit ProcessTree(std::size_t most = std::size_t{1} << 16U);

  // Those below `root`, without itself and without those that have ended (zombies). Empty where
  // /proc cannot be read.
  std::span<const TreeProcess> Look(pid_t root);

  // Ends all processes below this one, which must be a subreaper: stops them until no look finds
  // one that has not been stopped, so that none can start another one, then kills them and takes
  // note of their ends; again and again until there are none. False where some are left after
  // `patience_s` (in the kernel's hands, or another user's).
  bool EndAllBelowThis(double patience_s);

 private:
  bool StopAll(pid_t root);

  std::vector<TreeProcess> seen_;
  std::vector<pid_t> stopped_;
};

}  // namespace tsdfpp
