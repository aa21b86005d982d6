// What is left of an export that is stopped or killed.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

class InterruptedExport : public testing::Test {
 protected:
  // Starts an export of a scene and waits until it has written something.
  pid_t Start(int ignored = 0) {
    const std::string out = folder_ / "out";
    const pid_t process = fork();
    if (process == 0) {
      if (ignored != 0) signal(ignored, SIG_IGN);
      const int nowhere = open("/dev/null", O_WRONLY);
      dup2(nowhere, STDERR_FILENO);
      dup2(nowhere, STDOUT_FILENO);
      execl(TSDFPP_COMMAND, TSDFPP_COMMAND, "export", TSDFPP_SOURCE_DIR "/scenes/mini.toml", "--to",
            "tum", "--out", out.c_str(), nullptr);
      _exit(127);
    }
    const fs::path hidden = folder_ / fmt::format(".out.{}.part", process);
    while (!fs::exists(hidden / "depth") && waitpid(process, nullptr, WNOHANG) == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    EXPECT_TRUE(fs::exists(hidden));
    return process;
  }
  // The signal that ended it.
  static int End(pid_t process, int signal) {
    kill(process, signal);
    int status = 0;
    waitpid(process, &status, 0);
    return WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  }
  test::TempFolder folder_;
};

TEST_F(InterruptedExport, AStoppedOneLeavesNothing) {
  for (const int signal : {SIGINT, SIGTERM}) {
    EXPECT_EQ(End(Start(), signal), signal);
    EXPECT_TRUE(fs::is_empty(folder_.path()));
  }
}

// As what a script starts in the background ignores Ctrl-C.
TEST_F(InterruptedExport, ASignalThatIsIgnoredStaysSo) {
  for (const int signal : {SIGINT, SIGTERM}) {
    EXPECT_EQ(End(Start(signal), signal), 0);
    EXPECT_TRUE(fs::exists(folder_ / "out/rgb.txt"));
    fs::remove_all(folder_ / "out");
  }
}

TEST_F(InterruptedExport, TheNextOneRemovesWhatAKilledOneLeft) {
  const pid_t killed = Start();
  EXPECT_EQ(End(killed, SIGKILL), SIGKILL);
  const fs::path left = folder_ / fmt::format(".out.{}.part", killed);
  EXPECT_TRUE(fs::exists(left));
  EXPECT_EQ(End(Start(), SIGTERM), SIGTERM);
  EXPECT_FALSE(fs::exists(left));
}

}  // namespace
}  // namespace tsdfpp
