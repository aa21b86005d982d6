// How many threads of OpenMP the command's libraries get (core/own_environment.h).
#include <cstdlib>

#include "core/own_environment.h"

namespace tsdfpp {
namespace {

void LimitThreads(int /*argc*/, char** /*argv*/, char** /*environment*/) {
  if (std::getenv(kOpenMpThreads) != nullptr) return;
  if (setenv(kOpenMpThreads, "1", 1) == 0) setenv(kOwnOpenMpThreads, "1", 1);
}

// Run by the loader before the runtime's initialiser, which reads the environment once.
[[gnu::section(".preinit_array"), gnu::used]] void (*const kLimitThreads)(int, char**,
                                                                          char**) = LimitThreads;

}  // namespace
}  // namespace tsdfpp
