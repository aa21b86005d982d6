// Libraries of this build that are loaded where they are first needed. OpenCV's codecs and its
// encoder of films bring some 240 others, which the system would bind before a program begins.
#pragma once

#include "core/error.h"

namespace tsdfpp {

// The address of `function`, an extern "C" name, in `library`, a file's name that stands in the
// build's folder (tsdfpp_late_library in cmake/TsdfppTarget.cmake). The library stays for the rest
// of the process. Errors: kEnvironment, it cannot be loaded or has no such function.
Expected<void*> LateFunction(const char* library, const char* function);

}  // namespace tsdfpp
