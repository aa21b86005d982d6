#include "eval/adapters/process_tree.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <ctime>
#include <string_view>

namespace tsdfpp {
namespace {

// What getdents64(2) fills in; opendir(3) would allocate.
struct FolderEntry {
  std::uint64_t inode;
  std::int64_t offset;
  std::uint16_t length;
  unsigned char type;
  char name[1];  // and more, to a zero
};

bool IsNumber(std::string_view name) {
  return !name.empty() && name.front() >= '1' && name.front() <= '9';
}

// The words of a text between blanks, one after the other.
std::string_view NextWord(std::string_view& text) {
  const std::size_t start = text.find_first_not_of(' ');
  if (start == std::string_view::npos) return {};
  const std::size_t end = std::min(text.find(' ', start), text.size());
  const std::string_view word = text.substr(start, end - start);
  text.remove_prefix(end);
  return word;
}

std::int64_t NumberOfWord(std::string_view word) {
  std::int64_t value = 0;
  std::from_chars(word.data(), word.data() + word.size(), value);
  return value;
}

// A process' line in /proc (proc(5): stat). False where it is gone.
bool ReadProcess(int proc, std::string_view number, TreeProcess& process) {
  std::array<char, 64> path{};
  constexpr std::string_view kStat = "/stat";
  if (number.size() + kStat.size() >= path.size()) return false;
  std::copy(kStat.begin(), kStat.end(), std::copy(number.begin(), number.end(), path.begin()));
  const int file = openat(proc, path.data(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  std::array<char, 1024> line{};
  const ssize_t length = read(file, line.data(), line.size());
  close(file);
  if (length <= 0) return false;
  std::string_view text(line.data(), static_cast<std::size_t>(length));
  // The second field is a name in brackets, which may hold anything.
  const std::size_t bracket = text.rfind(')');
  if (bracket == std::string_view::npos) return false;
  text.remove_prefix(bracket + 1);
  process = {};
  process.id = static_cast<pid_t>(NumberOfWord(number));
  const std::string_view state = NextWord(text);
  if (state.empty()) return false;
  process.state = state.front();
  process.parent = static_cast<pid_t>(NumberOfWord(NextWord(text)));
  constexpr int kResident = 24;
  for (int field = 5; field < kResident; ++field) NextWord(text);
  process.resident_pages = NumberOfWord(NextWord(text));
  return true;
}

double Now_s() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void Pause(long milliseconds) {
  const timespec time{0, milliseconds * 1'000'000};
  nanosleep(&time, nullptr);
}

// Takes note of children that have ended. False where there are no children at all.
bool ReapChildren() {
  while (true) {
    const pid_t ended = waitpid(-1, nullptr, WNOHANG);
    if (ended == 0) return true;
    if (ended < 0 && errno != EINTR) return false;
  }
}

}  // namespace

ProcessTree::ProcessTree(std::size_t most) {
  seen_.resize(most);
  stopped_.reserve(most);
}

std::span<const TreeProcess> ProcessTree::Look(pid_t root) {
  const int proc = open("/proc", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (proc < 0) return {};
  std::size_t count = 0;
  alignas(FolderEntry) std::array<char, 16384> entries{};
  while (true) {
    const long bytes = syscall(SYS_getdents64, proc, entries.data(), entries.size());
    if (bytes <= 0) break;
    for (long at = 0; at < bytes;) {
      const char* entry = entries.data() + at;
      FolderEntry head{};
      std::memcpy(&head, entry, offsetof(FolderEntry, name));
      const std::string_view name(entry + offsetof(FolderEntry, name));
      if (IsNumber(name) && count < seen_.size() && ReadProcess(proc, name, seen_[count])) ++count;
      at += head.length;
    }
  }
  close(proc);

  const auto end = seen_.begin() + static_cast<std::ptrdiff_t>(count);
  const auto by_id = [](const TreeProcess& a, const TreeProcess& b) { return a.id < b.id; };
  std::sort(seen_.begin(), end, by_id);
  // Numbers mostly grow from parents to children, so few rounds are needed.
  for (bool more = true; more;) {
    more = false;
    for (auto process = seen_.begin(); process != end; ++process) {
      if (process->below) continue;
      TreeProcess parent;
      parent.id = process->parent;
      const auto found = std::lower_bound(seen_.begin(), end, parent, by_id);
      process->below =
          process->parent == root || (found != end && found->id == parent.id && found->below);
      more = more || process->below;
    }
  }
  const auto rest = std::remove_if(seen_.begin(), end, [&](const TreeProcess& process) {
    return !process.below || process.id == root || process.state == 'Z' || process.state == 'X';
  });
  return {seen_.begin(), rest};
}

bool ProcessTree::StopAll(pid_t root) {
  stopped_.clear();
  constexpr int kMostLooks = 1000;
  for (int look = 0; look < kMostLooks; ++look) {
    bool more = false;
    for (const TreeProcess& process : Look(root)) {
      const auto place = std::lower_bound(stopped_.begin(), stopped_.end(), process.id);
      if (place != stopped_.end() && *place == process.id) continue;
      if (stopped_.size() == stopped_.capacity()) return false;
      kill(process.id, SIGSTOP);
      stopped_.insert(place, process.id);
      more = true;
    }
    if (!more) return true;
  }
  return false;
}

bool ProcessTree::EndAllBelowThis(double patience_s) {
  const pid_t root = getpid();
  const double end_s = Now_s() + patience_s;
  while (ReapChildren()) {
    if (Now_s() > end_s) return false;
    StopAll(root);
    for (const pid_t process : stopped_) kill(process, SIGKILL);
    Pause(2);
  }
  return true;
}

}  // namespace tsdfpp
