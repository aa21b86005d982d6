// A control group of the kernel ends what is in it.
#include "eval/adapters/control_group.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/needs.h"

namespace tsdfpp {
namespace {

std::vector<pid_t> ProcessesOf(const std::filesystem::path& group) {
  std::ifstream in(group / "cgroup.procs");
  std::vector<pid_t> processes;
  for (pid_t process = 0; in >> process;) processes.push_back(process);
  return processes;
}

TEST(ControlGroup, EndsWhatIsInIt) {
  const auto parent = WritableControlGroup();
  TSDFPP_NEEDS(parent.has_value(), "a control group (cgroup 2) in which it may make others");
  std::filesystem::path path;
  {
    auto group = ControlGroup::Make(*parent, 1'000'000'000, 1000);
    ASSERT_TRUE(group.has_value());
    path = group->path();
    TSDFPP_NEEDS(group->end_all() >= 0, "Linux 5.14");
    const pid_t child = fork();
    if (child == 0) {
      if (write(group->enter(), "0", 1) != 1) _exit(1);
      setsid();
      pause();
      _exit(0);
    }
    while (ProcessesOf(path) != std::vector<pid_t>{child}) usleep(1000);
    ASSERT_EQ(write(group->end_all(), "1", 1), 1);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace tsdfpp
