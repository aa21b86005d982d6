// How many threads of OpenMP the command's libraries get (core/own_environment.h).
#pragma once

namespace tsdfpp {

// One, in the calling thread and in those of TBB, unless the environment says otherwise. To be
// called first in main().
void LimitOpenMpThreads();

}  // namespace tsdfpp
