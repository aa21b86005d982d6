// Libraries of this build that are loaded where they are first needed. OpenCV's codecs bring some
// 240 others, and to bind those takes most commands longer than all that they do.
#pragma once

#include "core/error.h"

namespace tsdfpp {

// The address of `function`, an extern "C" name, in `library`, a file's name that stands in the
// program's folder of libraries (RUNPATH; core/CMakeLists.txt). The library stays for the rest of
// the process. Errors: kEnvironment, it cannot be loaded or has no such function.
Expected<void*> LateFunction(const char* library, const char* function);

}  // namespace tsdfpp
