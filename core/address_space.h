// Whether a process has reached a limit of its address space.
#pragma once

#include <cstdint>

namespace tsdfpp {

// Whether the process may have only so much address space (RLIMIT_AS, `ulimit -v`) and has come
// within kRoomForABlock of it. What fails then, fails for want of memory. Async-signal-safe.
inline constexpr std::uint64_t kRoomForABlock = 256U << 20U;  // bytes: blocks may be as large
bool IsOutOfAddressSpace();

}  // namespace tsdfpp
