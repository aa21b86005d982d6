#include <fcntl.h>
#include <unistd.h>

#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>

#include "core/guard.h"
#include "core/last_words.h"
#include "core/limits.h"

namespace tsdfpp {
namespace {

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

int GuardedMain(const char* program, const std::function<int()>& body) {
  FillClosedDescriptors();
  SpeakAs(program);
  HandleLastWords();  // again: a library may have handlers of its own since
  // Their warnings would stand before our sentence.
  setenv("EGL_LOG_LEVEL", "fatal", 0);
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
