// A control group of the kernel (cgroups(7), version 2) for a program and all that it starts, where
// this process may make one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace tsdfpp {

// The folder below which this process may make groups: its own group's. Nothing where there is no
// version 2, or where the kernel or the rights refuse.
std::optional<std::filesystem::path> WritableControlGroup();

// What such a group could do here, for people: "ends processes", "limits memory", ... Empty where
// there is none.
std::string ControlGroupAbilities();

// A new group, empty as yet. Removed in the end; what is still in it then stays.
class ControlGroup {
 public:
  // Below `parent`. Nothing where it cannot be made. Groups that killed processes left there are
  // removed. The kernel's limits are set where it has them: bytes that the group's processes cannot
  // give back (a program that wants more is killed), and threads.
  static std::optional<ControlGroup> Make(const std::filesystem::path& parent,
                                          std::int64_t memory_bytes, std::int64_t threads);
  ~ControlGroup();
  ControlGroup(ControlGroup&& other) noexcept;
  ControlGroup& operator=(ControlGroup&&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // Open for writing: who writes "0" enters the group; a "1" ends all that is in it (-1 before
  // Linux 5.14).
  int enter() const { return enter_; }
  int end_all() const { return end_all_; }
  // Whether the kernel has killed one of its processes for its memory.
  bool RanOutOfMemory() const;

 private:
  explicit ControlGroup(std::filesystem::path path);

  std::filesystem::path path_;
  int enter_ = -1;
  int end_all_ = -1;
};

}  // namespace tsdfpp
