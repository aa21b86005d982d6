#include "eval/adapters/control_group.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kGroupName = "tsdfpp-";

// Written in one piece, as the kernel's files want it. False where the kernel has no such file or
// refuses.
bool Tell(const fs::path& file, const std::string& text) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool told =
      write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  close(descriptor);
  return told;
}

// The group of this process, as a path from the root of version 2.
std::string OwnGroup() {
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (line.starts_with("0::")) return line.substr(3);
  }
  return "";
}

// Where a group can be seen: a line of mountinfo is "id parent device root place options - type
// ...", of which `root` is the group that is shown at `place`.
fs::path PlaceOfGroup(const std::string& group) {
  std::ifstream mounts("/proc/self/mountinfo");
  for (std::string line; std::getline(mounts, line);) {
    std::istringstream words(line);
    std::string skipped;
    std::string root;
    std::string place;
    words >> skipped >> skipped >> skipped >> root >> place;
    const std::size_t dash = line.find(" - cgroup2 ");
    if (dash == std::string::npos) continue;
    if (root == "/") return fs::path(place + group);
    if (group == root || group.starts_with(root + "/")) return place + group.substr(root.size());
  }
  return {};
}

// Groups of processes that are no more. The kernel refuses where anybody is in one.
void RemoveEmptyGroups(const fs::path& parent) {
  std::error_code failure;
  std::vector<fs::path> old;
  for (fs::directory_iterator entry(parent, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(kGroupName)) continue;
    pid_t process = 0;
    std::from_chars(name.data() + kGroupName.size(), name.data() + name.size(), process);
    if (process > 0 && kill(process, 0) != 0 && errno == ESRCH) old.push_back(entry->path());
  }
  for (const fs::path& group : old) rmdir(group.c_str());
}

}  // namespace

std::optional<fs::path> WritableControlGroup() {
  const std::string group = OwnGroup();
  if (group.empty()) return std::nullopt;
  const fs::path place = PlaceOfGroup(group);
  // To enter a group below, one must be allowed to change who is in this one.
  if (place.empty() || access(place.c_str(), W_OK | X_OK) != 0 ||
      access((place / "cgroup.procs").c_str(), W_OK) != 0) {
    return std::nullopt;
  }
  return place;
}

std::string ControlGroupAbilities() {
  const auto parent = WritableControlGroup();
  if (!parent) return "";
  const auto probe = ControlGroup::Make(*parent, 1 << 30, 1000);
  if (!probe) return "";
  std::string text;
  const auto add = [&](bool can, const char* what) {
    if (can) text += (text.empty() ? "" : ", ") + std::string(what);
  };
  std::error_code ignored;
  add(probe->end_all() >= 0, "ends processes");
  add(fs::exists(probe->path() / "memory.max", ignored), "limits memory");
  add(fs::exists(probe->path() / "pids.max", ignored), "limits threads");
  return text;
}

std::optional<ControlGroup> ControlGroup::Make(const fs::path& parent, std::int64_t memory_bytes,
                                               std::int64_t threads) {
  RemoveEmptyGroups(parent);
  static std::atomic<int> count{0};
  const fs::path path = parent / fmt::format("{}{}-{}", kGroupName, getpid(), count++);
  if (mkdir(path.c_str(), 0755) != 0) return std::nullopt;
  ControlGroup group(path);
  if (group.enter_ < 0) return std::nullopt;
  // Where the kernel's controllers are not for us, these files are not there, and the looks at
  // /proc have to do.
  if (Tell(path / "memory.max", std::to_string(memory_bytes))) {
    Tell(path / "memory.swap.max", "0");
  }
  Tell(path / "pids.max", std::to_string(threads));
  return group;
}

ControlGroup::ControlGroup(fs::path path)
    : path_(std::move(path)),
      enter_(open((path_ / "cgroup.procs").c_str(), O_WRONLY | O_CLOEXEC)),
      end_all_(open((path_ / "cgroup.kill").c_str(), O_WRONLY | O_CLOEXEC)) {}

ControlGroup::ControlGroup(ControlGroup&& other) noexcept
    : path_(std::exchange(other.path_, {})),
      enter_(std::exchange(other.enter_, -1)),
      end_all_(std::exchange(other.end_all_, -1)) {}

ControlGroup::~ControlGroup() {
  if (enter_ >= 0) close(enter_);
  if (end_all_ >= 0) close(end_all_);
  if (path_.empty()) return;
  // Who was killed leaves it in a moment.
  constexpr int kTries = 50;
  constexpr useconds_t kPause_us = 2000;
  for (int i = 0; i < kTries && rmdir(path_.c_str()) != 0 && errno == EBUSY; ++i) usleep(kPause_us);
}

bool ControlGroup::RanOutOfMemory() const {
  std::ifstream events(path_ / "memory.events");
  std::string name;
  std::int64_t count = 0;
  while (events >> name >> count) {
    if (name == "oom_kill" && count > 0) return true;
  }
  return false;
}

}  // namespace tsdfpp
