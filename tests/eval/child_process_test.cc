// Programs that do not want to end, nor to be counted, nor to be brief.
#include "eval/adapters/child_process.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <sstream>
#include <thread>

#include "core/files.h"
#include "core/one_line.h"
#include "eval/adapters/capped_log.h"
#include "eval/adapters/control_group.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

using test::TempFolder;
namespace fs = std::filesystem;

constexpr std::int64_t kMb = 1'000'000;
constexpr const char* kPython = "/usr/bin/python3";

std::string Text(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::vector<pid_t> Numbers(const fs::path& file) {
  std::istringstream text(Text(file));
  std::vector<pid_t> numbers;
  for (pid_t number = 0; text >> number;) numbers.push_back(number);
  return numbers;
}

bool IsThere(pid_t process) { return kill(process, 0) == 0; }

ChildLimits RoomyLimits(double time_s = 60, bool control_group = true) {
  ChildLimits limits;
  limits.time_s = time_s;
  limits.memory_bytes = 2000 * kMb;
  limits.control_group = control_group;
  return limits;
}

ChildOutcome RunWords(const TempFolder& folder, const std::vector<std::string>& words,
                      const ChildLimits& limits = RoomyLimits()) {
  return RunChildProcess("it", words, folder.path(), folder / "log", limits);
}

ChildOutcome RunPython(const TempFolder& folder, const std::string& script,
                       const ChildLimits& limits = RoomyLimits()) {
  return RunWords(folder, {kPython, "-c", script}, limits);
}

ChildOutcome Shell(const TempFolder& folder, const std::string& script,
                   const ChildLimits& limits = RoomyLimits()) {
  return RunChildProcess("it", {"sh", "-c", script}, folder.path(), folder / "log", limits);
}

TEST(ChildProcess, EndsWellAndIsMeasured) {
  const TempFolder folder;
  const ChildOutcome outcome = Shell(folder, "pwd; echo oops >&2; read x || echo no input");
  EXPECT_FALSE(outcome.failure.has_value());
  EXPECT_EQ(ReadFile(folder / "log").value_or(""),
            fs::canonical(folder.path()).string() + "\noops\nno input\n");
  EXPECT_GT(outcome.wall_s, 0);
  EXPECT_GT(outcome.peak_bytes, 100'000);  // no shell is smaller
}

TEST(ChildProcess, FailuresAreSentences) {
  const TempFolder folder;
  const ChildOutcome code = Shell(folder, "echo first; echo 'no such model'; exit 3");
  ASSERT_TRUE(code.failure.has_value());
  EXPECT_EQ(code.failure->kind, ErrorKind::kData);
  EXPECT_EQ(code.failure->message, "it: ended with exit code 3; " + (folder / "log").string() +
                                       " ends with: no such model");
  const ChildOutcome crash = Shell(folder, "kill -SEGV $$");
  ASSERT_TRUE(crash.failure.has_value());
  EXPECT_NE(crash.failure->message.find("was ended by signal 11"), std::string::npos);
  EXPECT_NE(crash.failure->message.find("it said nothing"), std::string::npos);
  const ChildOutcome missing =
      RunChildProcess("it", {"/nowhere/mapper"}, folder.path(), folder / "log", RoomyLimits());
  ASSERT_TRUE(missing.failure.has_value());
  EXPECT_EQ(missing.failure->kind, ErrorKind::kEnvironment);
  EXPECT_EQ(missing.failure->message,
            "it: '/nowhere/mapper' cannot be run (No such file or directory)");
}

TEST(ChildProcess, WhatHangsIsEndedWithAllThatItStarted) {
  const TempFolder folder;
  const ChildOutcome outcome =
      Shell(folder, "sleep 600 & echo $! > pid; sleep 600", RoomyLimits(3));
  ASSERT_TRUE(outcome.failure.has_value());
  EXPECT_NE(outcome.failure->message.find("ran longer than its limit of 3 s, and was ended"),
            std::string::npos)
      << outcome.failure->message;
  EXPECT_LT(outcome.wall_s, 60);
  const std::string pid = ReadFile(folder / "pid").value_or("");
  ASSERT_FALSE(pid.empty());
  // Killed: it is gone, or whoever adopted it still has to take note. On a busy machine the kernel
  // takes a while.
  constexpr int kMostLooks = 1000;
  std::string state = "S";
  for (int look = 0; look < kMostLooks && state != "Z" && !state.empty(); ++look) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::ifstream stat("/proc/" + pid.substr(0, pid.find('\n')) + "/stat");
    std::string text;
    state = std::getline(stat, text) ? text.substr(text.rfind(')') + 2, 1) : "";
  }
  EXPECT_TRUE(state == "Z" || state.empty()) << state;
}

// It goes on watching.
TEST(ChildProcess, WhoStopsHisWatcherMeetsHisLimit) {
  const TempFolder folder;
  const ChildOutcome outcome = Shell(
      folder, "for i in 1 2 3; do kill -STOP $PPID; sleep 0.3; done; sleep 600", RoomyLimits(3));
  ASSERT_TRUE(outcome.failure.has_value());
  EXPECT_NE(outcome.failure->message.find("ran longer than its limit of 3 s, and was ended"),
            std::string::npos)
      << outcome.failure->message;
}

TEST(ChildProcess, ALimitMayBeFarAway) {
  const TempFolder folder;
  const ChildOutcome outcome = Shell(folder, "sleep 1", RoomyLimits(1e300));
  EXPECT_FALSE(outcome.failure.has_value()) << outcome.failure->message;
}

TEST(ChildProcess, WhatEatsMemoryIsEnded) {
  const TempFolder folder;
  ChildLimits small = RoomyLimits();
  small.memory_bytes = 150 * kMb;
  const ChildOutcome outcome =
      RunChildProcess("it",
                      {"/usr/bin/python3", "-c",
                       "x = []\nwhile True:\n  x.append(bytearray(b'x') * 10_000_000)\n  "
                       "import time; time.sleep(0.02)"},
                      folder.path(), folder / "log", small);
  ASSERT_TRUE(outcome.failure.has_value());
  EXPECT_NE(outcome.failure->message.find("more than its limit of 150 MB"), std::string::npos)
      << outcome.failure->message;
  EXPECT_GT(outcome.peak_bytes, 150 * kMb);
}

std::string Message(const ChildOutcome& outcome) {
  return outcome.failure ? outcome.failure->message : "";
}

// A process of its own session, whose parent and grandparent have ended: written down in `pids`.
constexpr const char* kAway = R"(
import os, sys, time
def away(work):
    if os.fork(): return
    os.setsid()
    if os.fork(): os._exit(0)
    with open('pids', 'a') as file: file.write(f'{os.getpid()}\n')
    work()
    os._exit(0)
def written(count):
    while not os.path.exists('pids') or len(open('pids').readlines()) < count: time.sleep(0.01)
)";

// With a control group of the kernel, where one may be made, and without.
class ChildTree : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Ways, ChildTree, testing::Bool(), [](const auto& group) {
  return group.param ? "ControlGroup" : "ProcOnly";
});

TEST_P(ChildTree, WhoLeftTheGroupIsEndedWithTheProgram) {
  const TempFolder folder;
  const ChildOutcome outcome = RunPython(folder,
                                         std::string(kAway) +
                                             "for i in range(3):\n"
                                             "    away(lambda: time.sleep(600))\n"
                                             "written(3)\n",
                                         RoomyLimits(60, GetParam()));
  EXPECT_EQ(Message(outcome), "");
  EXPECT_GE(outcome.most_processes, 1);
  EXPECT_LT(outcome.wall_s, 60);
  const auto pids = Numbers(folder / "pids");
  ASSERT_EQ(pids.size(), 3U);
  for (const pid_t pid : pids) EXPECT_FALSE(IsThere(pid)) << pid;
}

TEST_P(ChildTree, WhoLeftTheGroupIsEndedAtTheLimitOfTime) {
  const TempFolder folder;
  const ChildOutcome outcome = RunPython(folder,
                                         std::string(kAway) +
                                             "away(lambda: time.sleep(600))\nwritten(1)\n"
                                             "time.sleep(600)\n",
                                         RoomyLimits(2, GetParam()));
  EXPECT_NE(Message(outcome).find("ran longer than its limit of 2 s, and was ended"),
            std::string::npos)
      << Message(outcome);
  const auto pids = Numbers(folder / "pids");
  ASSERT_EQ(pids.size(), 1U);
  EXPECT_FALSE(IsThere(pids[0]));
}

TEST_P(ChildTree, WhoLeftTheGroupIsCounted) {
  const TempFolder folder;
  ChildLimits limits = RoomyLimits(60, GetParam());
  limits.memory_bytes = 150 * kMb;
  const ChildOutcome outcome =
      RunPython(folder,
                std::string(kAway) +
                    "def eat():\n    x = bytearray(b'x') * 300_000_000\n    time.sleep(600)\n"
                    "away(eat)\ntime.sleep(600)\n",
                limits);
  EXPECT_NE(Message(outcome).find("limit of 150 MB"), std::string::npos) << Message(outcome);
  for (const pid_t pid : Numbers(folder / "pids")) EXPECT_FALSE(IsThere(pid));
}

TEST_P(ChildTree, TooManyProcessesAreEnded) {
  const TempFolder folder;
  ChildLimits limits = RoomyLimits(60, GetParam());
  limits.processes = 20;
  const ChildOutcome outcome =
      RunPython(folder,
                std::string(kAway) +
                    "for i in range(100):\n    away(lambda: time.sleep(600))\n"
                    "time.sleep(600)\n",
                limits);
  EXPECT_NE(Message(outcome).find("processes at once, more than its limit of 20, and was ended"),
            std::string::npos)
      << Message(outcome);
  EXPECT_GT(outcome.most_processes, 20);
  for (const pid_t pid : Numbers(folder / "pids")) EXPECT_FALSE(IsThere(pid));
}

// Each starts the next one and ends: there is never more than one, and never for long.
TEST_P(ChildTree, WhoKeepsStartingHimselfAnewIsEnded) {
  const TempFolder folder;
  const ChildOutcome outcome = RunPython(folder,
                                         "import os, time\n"
                                         "if os.fork():\n"
                                         "    time.sleep(0.3)\n"
                                         "    os._exit(0)\n"
                                         "os.setsid()\n"
                                         "for i in range(50000):\n"
                                         "    if os.fork(): os._exit(0)\n"
                                         "    with open('count', 'a') as f: f.write('x')\n",
                                         RoomyLimits(60, GetParam()));
  EXPECT_EQ(Message(outcome), "");
  const std::size_t count = Text(folder / "count").size();
  EXPECT_GT(count, 0U);
  EXPECT_LT(count, 50'000U);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_EQ(Text(folder / "count").size(), count);
}

TEST_P(ChildTree, AllEndsWhenWeAreKilled) {
  const TempFolder folder;
  const pid_t we = fork();
  if (we == 0) {
    RunPython(folder,
              std::string(kAway) +
                  "away(lambda: time.sleep(600))\nwritten(1)\n"
                  "with open('pids', 'a') as file: file.write(f'{os.getpid()}\\n')\n"
                  "time.sleep(600)\n",
              RoomyLimits(60, GetParam()));
    _exit(0);
  }
  const auto wait_for = [](const auto& done) {
    for (int look = 0; look < 3000 && !done(); ++look) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return done();
  };
  ASSERT_TRUE(wait_for([&] { return Numbers(folder / "pids").size() == 2; }));
  ASSERT_EQ(kill(we, SIGKILL), 0);
  waitpid(we, nullptr, 0);
  for (const pid_t pid : Numbers(folder / "pids")) {
    EXPECT_TRUE(wait_for([&] { return !IsThere(pid); })) << pid;
  }
}

TEST_P(ChildTree, WhoEndsHisWatcherHasFailed) {
  const TempFolder folder;
  const ChildOutcome outcome =
      RunWords(folder, {"sh", "-c", "kill -9 $PPID; sleep 600"}, RoomyLimits(60, GetParam()));
  EXPECT_NE(Message(outcome).find("it: ended the process that watches it"), std::string::npos)
      << Message(outcome);
}

TEST_P(ChildTree, WhatAProgramDoesToItsGroupStaysThere) {
  const TempFolder folder;
  const ChildOutcome outcome =
      RunWords(folder, {"sh", "-c", "kill -9 0"}, RoomyLimits(60, GetParam()));
  EXPECT_NE(Message(outcome).find("was ended by signal 9"), std::string::npos) << Message(outcome);
}

TEST(ChildOutput, OfTooMuchHeadAndTailAreKept) {
  const TempFolder folder;
  ChildLimits limits = RoomyLimits(30);
  limits.log_bytes = 10'000;
  const ChildOutcome outcome = RunWords(
      folder, {"sh", "-c", "echo the first; yes | head -c 3000000; echo the last; exit 1"}, limits);
  EXPECT_EQ(outcome.log_bytes, 3'000'019);
  EXPECT_TRUE(Message(outcome).ends_with("ends with: the last")) << Message(outcome);
  const std::string log = Text(folder / "log");
  EXPECT_TRUE(log.starts_with("the first\ny\n"));
  EXPECT_TRUE(log.ends_with("y\nthe last\n"));
  EXPECT_NE(log.find("\n[... 2990019 bytes are left out here ...]\n"), std::string::npos);
  EXPECT_LT(log.size(), 10'100U);
}

TEST(ChildOutput, WhoNeverStopsWritingIsEnded) {
  const TempFolder folder;
  ChildLimits limits = RoomyLimits(1);
  limits.log_bytes = 10'000;
  const ChildOutcome outcome = RunWords(folder, {"yes"}, limits);
  EXPECT_NE(Message(outcome).find("ran longer than its limit of 1 s"), std::string::npos);
  EXPECT_GT(outcome.log_bytes, kMb);
  EXPECT_LT(fs::file_size(folder / "log"), 10'100U);
}

// A sentence with half a character in it cannot go into a JSON file.
TEST(ChildOutput, ALineIsNotCutInTheMiddleOfACharacter) {
  const TempFolder folder;
  for (const char* blank : {"", "x", "xx"}) {
    const ChildOutcome outcome = RunPython(
        folder, fmt::format("import sys\nsys.stdout.buffer.write(('{}' + '\u20ac' * 400 + "
                            "'\\x1b[31m').encode() + b'\\xff\\n')\nsys.exit(1)",
                            blank));
    ASSERT_TRUE(outcome.failure.has_value());
    EXPECT_TRUE(IsShowable(Message(outcome))) << Message(outcome);
    EXPECT_TRUE(Message(outcome).ends_with("\u20ac\\x1b[31m\\xff")) << Message(outcome);
    EXPECT_NE(Message(outcome).find("ends with: ...\u20ac"), std::string::npos) << Message(outcome);
  }
}

TEST(ChildOutput, TooMuchOnDiskIsEnded) {
  const TempFolder folder;
  ChildLimits limits = RoomyLimits();
  limits.disk_bytes = 20 * kMb;
  const ChildOutcome many =
      RunWords(folder,
               {"sh", "-c",
                "for i in 1 2 3 4 5; do head -c 10000000 /dev/urandom > part$i; "
                "done; sleep 600"},
               limits);
  EXPECT_NE(Message(many).find("more than its limit of 20 MB, and was ended"), std::string::npos)
      << Message(many);
  EXPECT_NE(Message(many).find("to its folder"), std::string::npos) << Message(many);
  const TempFolder other;
  const ChildOutcome one = RunWords(folder, {"head", "-c", "30000000", "/dev/zero"}, limits);
  EXPECT_EQ(Message(one), "");  // to the log
  const ChildOutcome file =
      RunWords(folder, {"sh", "-c", "exec head -c 30000000 /dev/zero > big"}, limits);
  EXPECT_NE(Message(file).find("was ended by signal 25"), std::string::npos) << Message(file);
  EXPECT_NE(Message(file).find("a file may have 20 MB"), std::string::npos) << Message(file);
  EXPECT_LE(fs::file_size(folder / "big"), 20U * kMb);
}

TEST(ChildOutput, NoCoreIsDumped) {
  const TempFolder folder;
  EXPECT_EQ(Message(RunWords(folder, {"sh", "-c", "ulimit -c; ulimit -H -c"})), "");
  EXPECT_EQ(Text(folder / "log"), "0\n0\n");
}

// A log in the place of which something else lies is not written to.
TEST(ChildOutput, ALogThatIsALinkIsRefused) {
  const TempFolder folder;
  fs::create_symlink(folder / "elsewhere", folder / "log");
  const ChildOutcome outcome = RunWords(folder, {"true"});
  EXPECT_NE(Message(outcome).find("cannot be run"), std::string::npos) << Message(outcome);
  EXPECT_FALSE(fs::exists(folder / "elsewhere"));
}

}  // namespace
}  // namespace tsdfpp
