#include "viewer/report_template.h"

#include <cstddef>

// The file's bytes, between two labels; far larger than what compilers take as a literal.
__asm__(
    ".section .rodata\n"
    ".global tsdfpp_report_page\n"
    "tsdfpp_report_page:\n"
    ".incbin \"" TSDFPP_REPORT_PAGE
    "\"\n"
    ".global tsdfpp_report_page_end\n"
    "tsdfpp_report_page_end:\n"
    ".byte 0\n"
    ".previous\n");

extern "C" {
extern const char tsdfpp_report_page[];
extern const char tsdfpp_report_page_end[];
}

namespace tsdfpp {

std::string_view ReportTemplate() {
  return {tsdfpp_report_page,
          static_cast<std::size_t>(tsdfpp_report_page_end - tsdfpp_report_page)};
}

}  // namespace tsdfpp
