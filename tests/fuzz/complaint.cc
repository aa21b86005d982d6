#include "tests/fuzz/complaint.h"

#include <cstdio>
#include <cstdlib>

#include "core/one_line.h"

namespace tsdfpp::fuzz {

void Require(bool holds, std::string_view sentence) {
  if (holds) return;
  std::fprintf(stderr, "complaint: %.*s\n", static_cast<int>(sentence.size()), sentence.data());
  std::abort();
}

std::optional<std::string> FaultOf(const Error& error, std::string_view named) {
  constexpr std::size_t kMostBytes = 500;
  if (error.kind == ErrorKind::kInternal) return "an internal error: " + error.message;
  // As core/guard.h prints it.
  const std::string shown = OneLine(error.message);
  if (shown.empty()) return "an error without a sentence";
  if (!IsShowable(shown)) return "a sentence that cannot be printed: " + error.message;
  if (shown.size() >= kMostBytes) return "a sentence of 500 bytes or more: " + shown;
  if (shown.find(named) == std::string::npos) {
    return "a sentence that does not name '" + std::string(named) + "': " + shown;
  }
  return std::nullopt;
}

}  // namespace tsdfpp::fuzz
