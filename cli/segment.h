// `tsdfpp segment`: a frame's segments as images of ids.
#pragma once

#include "cli/command.h"

namespace tsdfpp {

Run AddSegment(CLI::App& app, const CommonOptions& common);

}  // namespace tsdfpp
