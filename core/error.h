// Expected failures are values: a function that can fail on bad input returns Expected<T>.
#pragma once

#include <fmt/format.h>

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace tsdfpp {

// What went wrong, which is also the process's exit code (docs/command-line.md).
enum class ErrorKind {
  kUsage = 2,        // something the user typed or wrote is wrong: an option, a TOML file
  kEnvironment = 3,  // the machine lacks something: GL, a library, disk
  kData = 4,         // data on disk cannot be used
  kInternal = 5,     // a fault of the program itself (core/guard.h)
};

// One clear sentence: which file, field or option, what was found, what was expected.
struct Error {
  ErrorKind kind = ErrorKind::kUsage;
  std::string message;
};

template <typename T>
using Expected = tl::expected<T, Error>;

template <typename... Args>
tl::unexpected<Error> UsageError(fmt::format_string<Args...> format, Args&&... args) {
  return tl::unexpected(Error{ErrorKind::kUsage, fmt::format(format, std::forward<Args>(args)...)});
}
template <typename... Args>
tl::unexpected<Error> EnvironmentError(fmt::format_string<Args...> format, Args&&... args) {
  return tl::unexpected(
      Error{ErrorKind::kEnvironment, fmt::format(format, std::forward<Args>(args)...)});
}
template <typename... Args>
tl::unexpected<Error> DataError(fmt::format_string<Args...> format, Args&&... args) {
  return tl::unexpected(Error{ErrorKind::kData, fmt::format(format, std::forward<Args>(args)...)});
}

}  // namespace tsdfpp

// Returns the error of an Expected from the enclosing function.
#define TSDFPP_RETURN_IF_ERROR(expression)                               \
  do {                                                                   \
    if (auto tsdfpp_status = (expression); !tsdfpp_status.has_value()) { \
      return tl::unexpected(std::move(tsdfpp_status.error()));           \
    }                                                                    \
  } while (false)

#define TSDFPP_CONCAT_INNER(a, b) a##b
#define TSDFPP_CONCAT(a, b) TSDFPP_CONCAT_INNER(a, b)
// TSDFPP_ASSIGN(auto x, Function()): x is the value, or the enclosing function returns the error.
#define TSDFPP_ASSIGN(declaration, expression)                                        \
  auto TSDFPP_CONCAT(tsdfpp_value_, __LINE__) = (expression);                         \
  if (!TSDFPP_CONCAT(tsdfpp_value_, __LINE__).has_value()) {                          \
    return tl::unexpected(std::move(TSDFPP_CONCAT(tsdfpp_value_, __LINE__).error())); \
  }                                                                                   \
  declaration = std::move(TSDFPP_CONCAT(tsdfpp_value_, __LINE__).value())
