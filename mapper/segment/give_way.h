// A thread beside the frames' own, which must not hold them up.
#pragma once

namespace tsdfpp {

// From now on, for as long as it lives, this thread has a core only where nobody else wants one
// (Linux's SCHED_IDLE), and others that wake have it at once. Where TBB has a thread for each core
// that this one may use, it keeps to the last of these cores alone: else the system, which counts
// it like the others, at times leaves it one core and puts all that the frames need on the other.
// Where the system refuses, all is as before.
void GiveWay();

}  // namespace tsdfpp
