// Variables of the environment that we set for our own libraries, and that no program of others'
// that we start may see.
#pragma once

namespace tsdfpp {

// OpenMP's runtime ends a process that cannot make a thread with exit code 1 and words of its own,
// and nothing of the command gains by it: what takes time is TBB's. So the command's libraries get
// one thread of it, unless the environment says otherwise.
inline constexpr const char* kOpenMpThreads = "OMP_NUM_THREADS";
// Set where kOpenMpThreads is ours.
inline constexpr const char* kOwnOpenMpThreads = "TSDFPP_OWN_OMP_NUM_THREADS";

// Takes what is ours out of `environment` (as execve(2) gets it), which may be what a process that
// was just forked has. Async-signal-safe.
void TakeOutOwn(char** environment);

}  // namespace tsdfpp
