// What the nightly run asks of some tests beyond what a build's tests have time for.
#pragma once

#include <cstdlib>

namespace tsdfpp::test {

// Whether TSDFPP_THOROUGH is in the environment, as in scripts/nightly.sh.
inline bool Thorough() { return std::getenv("TSDFPP_THOROUGH") != nullptr; }

}  // namespace tsdfpp::test
