#include "core/quiet_stderr.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>

#include "core/guard.h"

namespace tsdfpp {
namespace {

std::recursive_mutex& StderrMutex() {
  static std::recursive_mutex mutex;
  return mutex;
}

// A file in memory, or else nowhere.
int OpenPlace() {
  const int memory = memfd_create("tsdfpp-words", MFD_CLOEXEC);
  return memory >= 0 ? memory : open("/dev/null", O_RDWR | O_CLOEXEC);
}

}  // namespace

QuietStderr::QuietStderr()
    : lock_(StderrMutex()), saved_(fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0)), words_(OpenPlace()) {
  if (saved_ < 0 || words_ < 0) return;
  dup2(words_, STDERR_FILENO);
  // Of several the first one knows where it led.
  before_ = StderrDescriptor();
  if (before_ == STDERR_FILENO) SetStderrDescriptor(saved_);
}

QuietStderr::~QuietStderr() {
  if (saved_ >= 0) {
    dup2(saved_, STDERR_FILENO);
    SetStderrDescriptor(before_);
    close(saved_);
  }
  if (words_ >= 0) close(words_);
}

std::string QuietStderr::Words() const {
  std::string words;
  std::array<char, 4096> block{};
  while (words_ >= 0) {
    const ssize_t count =
        pread(words_, block.data(), block.size(), static_cast<off_t>(words.size()));
    if (count <= 0) break;
    words.append(block.data(), static_cast<std::size_t>(count));
  }
  return words;
}

}  // namespace tsdfpp
