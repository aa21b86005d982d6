#include "eval/run/program_identity.h"

#include "program_hash.h"

namespace tsdfpp {

std::string ProgramIdentity() { return TSDFPP_VERSION " " TSDFPP_PROGRAM_HASH; }

}  // namespace tsdfpp
