#include "core/quiet_stderr.h"

#include <fcntl.h>
#include <unistd.h>

namespace tsdfpp {
namespace {

std::mutex& StderrMutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

QuietStderr::QuietStderr()
    : lock_(StderrMutex()), saved_(fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0)) {
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (saved_ >= 0 && nowhere >= 0) dup2(nowhere, STDERR_FILENO);
  if (nowhere >= 0) close(nowhere);
}

QuietStderr::~QuietStderr() {
  if (saved_ < 0) return;
  dup2(saved_, STDERR_FILENO);
  close(saved_);
}

}  // namespace tsdfpp
