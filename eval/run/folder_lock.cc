#include "eval/run/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace tsdfpp {

Expected<FolderLock> FolderLock::Take(const std::filesystem::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) {
    return EnvironmentError("{}: cannot be opened ({})", folder.string(), std::strerror(errno));
  }
  // The children of a process that was killed follow it in a moment.
  constexpr int kTries = 40;
  constexpr useconds_t kPause_us = 50000;
  for (int i = 0; i < kTries; ++i) {
    if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) return FolderLock(descriptor);
    const int fault = errno;
    if (fault != EWOULDBLOCK && fault != EINTR) {
      close(descriptor);
      return EnvironmentError("{}: cannot be locked ({})", folder.string(), std::strerror(fault));
    }
    usleep(kPause_us);
  }
  close(descriptor);
  return EnvironmentError("{}: another process is working in this folder", folder.string());
}

FolderLock::FolderLock(FolderLock&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}

FolderLock::~FolderLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace tsdfpp
