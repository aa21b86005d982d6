// `tsdfpp report`.
#pragma once

#include "cli/command.h"

namespace tsdfpp {

Run AddReport(CLI::App& app, const CommonOptions& common);

}  // namespace tsdfpp
