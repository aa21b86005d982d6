#include "core/address_space.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>

namespace tsdfpp {

bool IsOutOfAddressSpace() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return false;
  const int file = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  std::array<char, 32> text{};
  const ssize_t count = read(file, text.data(), text.size());
  close(file);
  std::uint64_t pages = 0;  // the first number
  for (ssize_t i = 0; i < count; ++i) {
    const char c = text[static_cast<std::size_t>(i)];
    if (c < '0' || c > '9') break;
    pages = 10 * pages + static_cast<std::uint64_t>(c - '0');
  }
  const auto page = static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  return pages * page + kRoomForABlock > limit.rlim_cur;
}

}  // namespace tsdfpp
