#include "core/guard.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <string>

#include "core/limits.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

constexpr const char* kOutOfMemory = "out of memory: what was asked for needs more than there is";

// Of the program, for the handler below, which takes no argument.
std::string& NameOfProgram() {
  static std::string name = "tsdfpp";
  return name;
}

// An exception that leaves a destructor, a thread or a noexcept function: nobody can catch it, but
// it can be said in a line.
[[noreturn]] void SayAndAbort() {
  if (std::current_exception()) {
    try {
      std::rethrow_exception(std::current_exception());
    } catch (...) {
      PrintError(NameOfProgram(), ErrorOfException().message);
    }
  }
  std::abort();
}

// A standard descriptor that is closed would go to the next file that is opened, which then gets
// what is printed.
void FillClosedDescriptors() {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(descriptor, F_GETFD) >= 0) continue;
    // It gets the lowest number that is free. A result cannot be written to stdout, as before.
    if (open("/dev/null", descriptor == STDERR_FILENO ? O_WRONLY : O_RDONLY) < 0) return;
  }
}

}  // namespace

Error ErrorOfException() {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return {ErrorKind::kEnvironment, kOutOfMemory};
  } catch (const std::filesystem::filesystem_error& error) {
    return {ErrorKind::kEnvironment,
            fmt::format("{}: {}", error.path1().string(), error.code().message())};
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) return {ErrorKind::kEnvironment, kOutOfMemory};
    return {ErrorKind::kInternal, fmt::format("internal error, in OpenCV: {}", error.err)};
  } catch (const std::exception& error) {
    return {ErrorKind::kInternal, fmt::format("internal error: {}", error.what())};
  } catch (...) {
    return {ErrorKind::kInternal, "internal error"};
  }
}

void PrintError(std::string_view program, std::string_view message) {
  std::fprintf(stderr, "%s: %s\n", std::string(program).c_str(), OneLine(message).c_str());
}

int GuardedMain(std::string_view program, const std::function<int()>& body) {
  FillClosedDescriptors();
  NameOfProgram() = program;
  std::set_terminate(SayAndAbort);
  // Its warnings would stand before our sentence.
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  const auto code = Guarded([&]() -> Expected<int> {
    TSDFPP_RETURN_IF_ERROR(SetLimitsFromEnvironment());
    return body();
  });
  if (code) return *code;
  PrintError(program, code.error().message);
  return static_cast<int>(code.error().kind);
}

}  // namespace tsdfpp
