// One process at a time works in a folder.
#pragma once

#include <filesystem>

#include "core/error.h"

namespace tsdfpp {

class FolderLock {
 public:
  // Locks the folder itself, which must be there. Errors: kEnvironment where another process has
  // it, or where the file system has no locks.
  static Expected<FolderLock> Take(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&&) = delete;

 private:
  explicit FolderLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace tsdfpp
