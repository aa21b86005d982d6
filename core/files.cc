#include "core/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <functional>

namespace tsdfpp {
namespace fs = std::filesystem;

namespace {

// A file's descriptor, closed at the end.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

const char* KindOf(const struct stat& status) {
  if (S_ISREG(status.st_mode)) return "a file";
  if (S_ISDIR(status.st_mode)) return "a folder";
  if (S_ISFIFO(status.st_mode)) return "a pipe";
  return S_ISSOCK(status.st_mode) ? "a socket" : "a device";
}

Expected<void> CheckKind(const struct stat& status, const fs::path& path) {
  if (S_ISREG(status.st_mode)) return {};
  if (S_ISDIR(status.st_mode)) return DataError("{}: is a folder, not a file", path.string());
  return DataError("{}: is {}, expected a regular file", path.string(), KindOf(status));
}

Error CannotRead(const fs::path& path, int number) {
  if (number == ENOENT || number == ENOTDIR) {
    return {ErrorKind::kData, fmt::format("{}: no such file", path.string())};
  }
  return {ErrorKind::kData,
          fmt::format("{}: cannot be read ({})", path.string(), std::strerror(number))};
}

// A file while it is written, hidden beside its place. It is named after that place alone, so that
// the next one writes over what a killed process left. It is locked: a second process (or thread)
// that writes the same file meanwhile takes a name of its own.
class PartFile {
 public:
  explicit PartFile(const fs::path& place) {
    constexpr std::size_t kLongestName = 200;
    std::string name = place.filename().string();
    if (name.size() > kLongestName) {
      const std::size_t hash = std::hash<std::string>()(name);
      name = fmt::format("{}.{:016x}", name.substr(0, kLongestName), hash);
    }
    path_ = place.parent_path() / fmt::format(".{}.writing.part", name);
    if (OpenShared()) return;
    static std::atomic<int> count{0};
    path_ = place.parent_path() / fmt::format(".{}.{}-{}.part", name, getpid(), count++);
    number_ = open(path_.c_str(), kFlags | O_EXCL, kMode);
    fault_ = errno;
  }
  ~PartFile() {
    if (number_ < 0) return;
    // Before the lock goes with the descriptor.
    if (!placed_) unlink(path_.c_str());
    close(number_);
  }
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  // Each is 0, or the number of what went wrong.
  int Write(std::string_view bytes) const {
    if (number_ < 0) return fault_;
    while (!bytes.empty()) {
      const ssize_t count = write(number_, bytes.data(), bytes.size());
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return errno;
      bytes.remove_prefix(static_cast<std::size_t>(count));
    }
    // Some file systems say it when the file is closed alone; the lock has to stay until it has its
    // place.
    const int twin = fcntl(number_, F_DUPFD_CLOEXEC, 0);
    return twin < 0 || close(twin) != 0 ? errno : 0;
  }
  int TakeThePlace(const fs::path& place) {
    placed_ = rename(path_.c_str(), place.c_str()) == 0;
    return placed_ ? 0 : errno;
  }

 private:
  // Without O_NONBLOCK a pipe of this name would be waited for.
  static constexpr int kFlags = O_WRONLY | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
  static constexpr mode_t kMode = 0666;

  bool OpenShared() {
    number_ = open(path_.c_str(), kFlags, kMode);
    if (number_ < 0) return false;
    struct stat held {};
    struct stat named {};
    // Who held it before may have put it in its place after it was opened here.
    const bool ours = flock(number_, LOCK_EX | LOCK_NB) == 0 && fstat(number_, &held) == 0 &&
                      lstat(path_.c_str(), &named) == 0 && held.st_ino == named.st_ino &&
                      held.st_dev == named.st_dev && S_ISREG(held.st_mode) && held.st_nlink == 1;
    if (ours && (held.st_size == 0 || ftruncate(number_, 0) == 0)) return true;
    close(number_);
    number_ = -1;
    return false;
  }

  fs::path path_;
  int number_ = -1;
  int fault_ = 0;
  bool placed_ = false;
};

}  // namespace

Expected<void> CheckRegularFile(const fs::path& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return tl::unexpected(CannotRead(path, errno));
  return CheckKind(status, path);
}

Expected<std::string> ReadFile(const fs::path& path, Limit limit) {
  // Some devices do something when they are opened, so the kind comes first.
  TSDFPP_RETURN_IF_ERROR(CheckRegularFile(path));
  const Descriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  if (file.number() < 0 || fstat(file.number(), &status) != 0) {
    return tl::unexpected(CannotRead(path, errno));
  }
  TSDFPP_RETURN_IF_ERROR(CheckKind(status, path));
  TSDFPP_RETURN_IF_ERROR(CheckLimit(limit, status.st_size, path.string(), "bytes"));
  std::string bytes;
  std::size_t size = 0;
  // Files of /proc say that they are empty, others may grow: what there is decides.
  constexpr std::size_t kBlock = 65536;
  bytes.resize(static_cast<std::size_t>(status.st_size) + kBlock);
  while (true) {
    const ssize_t count = read(file.number(), bytes.data() + size, bytes.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return tl::unexpected(CannotRead(path, errno));
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
    TSDFPP_RETURN_IF_ERROR(
        CheckLimit(limit, static_cast<std::int64_t>(size), path.string(), "bytes"));
    if (size == bytes.size()) bytes.resize(2 * size);
  }
  bytes.resize(size);
  return bytes;
}

Expected<void> WriteFile(const fs::path& path, std::string_view bytes) {
  if (path.has_parent_path()) {
    std::error_code code;
    fs::create_directories(path.parent_path(), code);
    if (code) {
      return EnvironmentError("{}: the folder cannot be made ({})", path.parent_path().string(),
                              code.message());
    }
  }
  // What is in place goes; a device or a pipe is nobody's old result, also behind a link.
  struct stat status {};
  if (stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
    return EnvironmentError("{}: is {}, expected a regular file or nothing", path.string(),
                            KindOf(status));
  }
  PartFile part(path);
  int fault = part.Write(bytes);
  if (fault == 0) fault = part.TakeThePlace(path);
  if (fault != 0) {
    return EnvironmentError("{}: cannot be written ({})", path.string(), std::strerror(fault));
  }
  return {};
}

Expected<void> MakeWritableFolder(const fs::path& path) {
  std::error_code code;
  fs::create_directories(path, code);
  if (code)
    return EnvironmentError("{}: the folder cannot be made ({})", path.string(), code.message());
  const fs::path probe = path / ".tsdfpp-probe";
  if (!WriteFile(probe, "").has_value()) {
    return EnvironmentError("{}: the folder cannot be written to", path.string());
  }
  fs::remove(probe, code);
  return {};
}

}  // namespace tsdfpp
