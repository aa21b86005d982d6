// The page of `tsdfpp report` without data (viewer/src), as it was bundled when this was built.
#pragma once

#include <string_view>

namespace tsdfpp {

// Where the data goes; the template has it once.
inline constexpr std::string_view kReportDataMark = "<!--tsdfpp:data-->";

// Empty where the build had no Node.js.
std::string_view ReportTemplate();

}  // namespace tsdfpp
