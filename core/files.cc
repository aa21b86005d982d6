#include "core/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
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

Expected<void> CheckKind(const struct stat& status, const fs::path& path) {
  if (S_ISREG(status.st_mode)) return {};
  if (S_ISDIR(status.st_mode)) return DataError("{}: is a folder, not a file", path.string());
  const char* kind = S_ISFIFO(status.st_mode)   ? "a pipe"
                     : S_ISSOCK(status.st_mode) ? "a socket"
                                                : "a device";
  return DataError("{}: is {}, expected a regular file", path.string(), kind);
}

Error CannotRead(const fs::path& path, int number) {
  if (number == ENOENT || number == ENOTDIR) {
    return {ErrorKind::kData, fmt::format("{}: no such file", path.string())};
  }
  return {ErrorKind::kData,
          fmt::format("{}: cannot be read ({})", path.string(), std::strerror(number))};
}

// The name of the file while it is written: beside `path`, and no longer than a name can be.
fs::path TemporaryOf(const fs::path& path) {
  constexpr std::size_t kLongestName = 200;
  std::string name = path.filename().string();
  if (name.size() > kLongestName) {
    const std::size_t hash = std::hash<std::string>()(name);
    name = fmt::format("{}.{:016x}", name.substr(0, kLongestName), hash);
  }
  return path.parent_path() / fmt::format("{}.{}.part", name, getpid());
}

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
  const fs::path temporary = TemporaryOf(path);
  {
    std::ofstream out(temporary, std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) {
      std::error_code ignored;
      fs::remove(temporary, ignored);
      return EnvironmentError("{}: cannot be written", path.string());
    }
  }
  std::error_code code;
  fs::rename(temporary, path, code);
  if (code) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    return EnvironmentError("{}: cannot be written ({})", path.string(), code.message());
  }
  return {};
}

Expected<void> MakeWritableFolder(const fs::path& path) {
  std::error_code code;
  fs::create_directories(path, code);
  if (code)
    return EnvironmentError("{}: the folder cannot be made ({})", path.string(), code.message());
  const fs::path probe = path / fmt::format(".tsdfpp-probe-{}", getpid());
  if (!WriteFile(probe, "").has_value()) {
    return EnvironmentError("{}: the folder cannot be written to", path.string());
  }
  fs::remove(probe, code);
  return {};
}

}  // namespace tsdfpp
