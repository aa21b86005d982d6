// Which program made a result.
#pragma once

#include <string>

namespace tsdfpp {

// "0.1.0 <hash>": the version, and 16 hexadecimal digits of the SHA-256 of all sources, the
// compiler and the build type that figures depend on (eval/CMakeLists.txt lists them). Two programs
// of one identity give the same bytes for the same input.
std::string ProgramIdentity();

}  // namespace tsdfpp
