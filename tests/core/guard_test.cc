#include "core/guard.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "core/limits.h"
#include "core/quiet_stderr.h"

namespace tsdfpp {
namespace {

// What GuardedMain prints and returns.
struct Ended {
  int code = -1;
  std::string said;
};
Ended EndOf(const std::function<int()>& body) {
  testing::internal::CaptureStderr();
  const int code = GuardedMain("program", body);
  return {code, testing::internal::GetCapturedStderr()};
}

TEST(Guard, WhatIsThrownBecomesASentenceAndACode) {
  const Ended memory = EndOf([]() -> int { throw std::bad_alloc(); });
  EXPECT_EQ(memory.code, 3);
  EXPECT_EQ(memory.said, "program: out of memory: what was asked for needs more than there is\n");
  const Ended files = EndOf([]() -> int {
    std::filesystem::directory_iterator("/no/such/folder");
    return 0;
  });
  EXPECT_EQ(files.code, 3);
  EXPECT_EQ(files.said, "program: /no/such/folder: No such file or directory\n");
  const Ended opencv = EndOf([]() -> int {
    cv::Mat image(4, 1, CV_8UC3);
    cv::repeat(image, 1, 2, image);  // as it once was with an image of one column
    return 0;
  });
  EXPECT_EQ(opencv.code, 5);
  EXPECT_TRUE(opencv.said.starts_with("program: internal error, in OpenCV: ")) << opencv.said;
  const Ended other = EndOf([]() -> int { throw std::runtime_error("two\nlines\x01"); });
  EXPECT_EQ(other.code, 5);
  EXPECT_EQ(other.said, "program: internal error: two lines\\x01\n");
  const Ended unknown = EndOf([]() -> int { throw 7; });
  EXPECT_EQ(unknown.code, 5);
  EXPECT_EQ(unknown.said, "program: internal error\n");
}

TEST(Guard, ACodeThatIsReturnedIsKept) {
  const Ended ended = EndOf([] { return 4; });
  EXPECT_EQ(ended.code, 4);
  EXPECT_EQ(ended.said, "");
}

// A file with the number of stderr would get what is printed.
TEST(Guard, NoFileGetsTheNumberOfAStandardDescriptor) {
  const pid_t child = fork();
  if (child == 0) {
    for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) close(descriptor);
    _exit(GuardedMain("program", [] {
      const int opened = open("/dev/null", O_RDONLY);
      // As before, a result cannot be written to a stdout that was closed.
      return opened > STDERR_FILENO && write(STDOUT_FILENO, "x", 1) < 0 && errno == EBADF ? 0 : 1;
    }));
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST(Guard, LimitsOfTheEnvironmentHoldOrAreRefused) {
  setenv("TSDFPP_LIMITS", "nesting=7", 1);
  const Ended good = EndOf([] { return static_cast<int>(CurrentLimits().nesting); });
  setenv("TSDFPP_LIMITS", "nesting=many", 1);
  const Ended bad = EndOf([] { return 0; });
  unsetenv("TSDFPP_LIMITS");
  SetLimits({});
  EXPECT_EQ(good.code, 7);
  EXPECT_EQ(bad.code, 2);
  EXPECT_EQ(bad.said,
            "program: TSDFPP_LIMITS: nesting is 'many', expected a whole number from 1 to 1000\n");
}

TEST(Guard, ErrorsPassThrough) {
  const auto error = Guarded([]() -> Expected<int> { return DataError("x: wrong"); });
  ASSERT_FALSE(error.has_value());
  EXPECT_EQ(error.error().message, "x: wrong");
  EXPECT_EQ(Guarded([]() -> Expected<int> { return 3; }).value(), 3);
  const auto thrown = Guarded([]() -> Expected<void> { throw std::length_error("vector"); });
  ASSERT_FALSE(thrown.has_value());
  EXPECT_EQ(thrown.error().kind, ErrorKind::kInternal);
}

// A piece that is too large, while smaller ones can be had.
TEST(Guard, LibrariesWordsForWantOfMemoryAreKnown) {
  for (const char* words : {"[Open3D Error] MemoryManagerCPU.cpp:39: CPU malloc failed",
                            "mmap: Cannot allocate memory"}) {
    const auto thrown = Guarded([&]() -> Expected<void> { throw std::runtime_error(words); });
    ASSERT_FALSE(thrown.has_value());
    EXPECT_EQ(thrown.error().kind, ErrorKind::kEnvironment);
    EXPECT_TRUE(thrown.error().message.starts_with("out of memory")) << thrown.error().message;
  }
}

TEST(Guard, MessagesAreOneLineOfText) {
  testing::internal::CaptureStderr();
  PrintError("program", "a\nb\x1b[31m\xff" + std::string(10'000, 'x'));
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_TRUE(said.starts_with("program: a b\\x1b[31m\\xffxxx")) << said;
  EXPECT_LT(said.size(), 500U);
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1);
}

[[maybe_unused]] void ThrowForMemory() { throw std::bad_alloc(); }
void ThrowLate() { throw std::runtime_error("late"); }

TEST(GuardDeathTest, WhatNobodyCanCatchIsSaidBeforeTheEnd) {
  EXPECT_EXIT(GuardedMain("program",
                          [] {
                            const auto end = []() noexcept { ThrowLate(); };
                            end();
                            return 0;
                          }),
              testing::KilledBySignal(SIGABRT), "program: internal error: late");
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

// Leaves the process no more address space than it has.
void LeaveNoMemory() {
  const rlimit none{1, RLIM_INFINITY};
  setrlimit(RLIMIT_AS, &none);
}

int RunWithoutMemory(const std::function<void()>& fail) {
  return GuardedMain("program", [&] {
    LeaveNoMemory();
    fail();
    return 0;
  });
}

constexpr const char* kNoMemory = "^program: out of memory: [^\n]*\n$";

TEST(GuardDeathTest, WantOfMemoryThatNobodyCanCatchIsSaid) {
  EXPECT_EXIT(GuardedMain("program",
                          [] {
                            const auto end = []() noexcept { ThrowForMemory(); };
                            end();
                            return 0;
                          }),
              testing::ExitedWithCode(3), kNoMemory);
  EXPECT_EXIT(RunWithoutMemory([] { raise(SIGSEGV); }), testing::ExitedWithCode(3), kNoMemory);
  // Within what keeps a library's words from stderr.
  EXPECT_EXIT(GuardedMain("program",
                          [] {
                            const QuietStderr outer;
                            const QuietStderr inner;
                            std::fputs("of a library", stderr);
                            LeaveNoMemory();
                            return raise(SIGSEGV);
                          }),
              testing::ExitedWithCode(3), kNoMemory);
  EXPECT_EXIT(RunWithoutMemory([] { std::abort(); }), testing::ExitedWithCode(3), kNoMemory);
  // A library's own words for it are caught; the test's process has no memory left to end well.
  EXPECT_EXIT(_exit(RunWithoutMemory([] { throw std::runtime_error("pthread_create failed"); })),
              testing::ExitedWithCode(3), kNoMemory);
}

// With memory to be had a crash is a crash.
TEST(GuardDeathTest, OtherSignalsAreWhatTheyWere) {
  EXPECT_EXIT(GuardedMain("program", [] { return raise(SIGSEGV); }),
              testing::KilledBySignal(SIGSEGV), "^$");
  EXPECT_EXIT(GuardedMain("program", []() -> int { std::abort(); }),
              testing::KilledBySignal(SIGABRT), "^$");
}

#endif

}  // namespace
}  // namespace tsdfpp
