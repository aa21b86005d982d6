#include "eval/child_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <sstream>
#include <thread>

#include "core/files.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kExitLook_s = 0.01;
constexpr std::size_t kLogTail = 200;

// Resident memory of all processes of a group, from /proc (proc(5): fields 5 and 24 of stat).
std::int64_t ResidentOfGroup(pid_t group) {
  std::int64_t pages = 0;
  std::error_code failure;
  for (fs::directory_iterator entry("/proc", failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const std::string name = entry->path().filename().string();
    if (name.empty() || std::isdigit(static_cast<unsigned char>(name.front())) == 0) continue;
    std::ifstream stat(entry->path() / "stat");
    std::string text((std::istreambuf_iterator<char>(stat)), std::istreambuf_iterator<char>());
    // The second field is a name in brackets, which may hold anything.
    const std::size_t bracket = text.rfind(')');
    if (bracket == std::string::npos) continue;
    std::istringstream fields(text.substr(bracket + 1));
    std::string state;
    std::int64_t parent = 0;
    std::int64_t of_group = 0;
    if (!(fields >> state >> parent >> of_group) || of_group != group) continue;
    std::string skipped;
    for (int field = 6; field < 24; ++field) fields >> skipped;
    std::int64_t resident = 0;
    if (fields >> resident) pages += resident;
  }
  return pages * sysconf(_SC_PAGESIZE);
}

// The last line of the log that says anything.
std::string EndOfLog(const fs::path& log) {
  const std::string text = ReadFile(log).value_or("");
  std::istringstream lines(text);
  std::string last;
  for (std::string line; std::getline(lines, line);) {
    if (std::any_of(line.begin(), line.end(),
                    [](unsigned char c) { return std::isgraph(c) != 0; })) {
      last = line;
    }
  }
  if (last.size() > kLogTail) last = "..." + last.substr(last.size() - kLogTail);
  return last;
}

// In the child, after the fork: only what is async-signal-safe.
[[noreturn]] void Become(char* const* words, const char* at, int log, int input, int report,
                         pid_t parent) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  std::signal(SIGPIPE, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  if (dup2(input, STDIN_FILENO) >= 0 && dup2(log, STDOUT_FILENO) >= 0 &&
      dup2(log, STDERR_FILENO) >= 0 && chdir(at) == 0) {
    close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
    execvp(words[0], words);
  }
  const int failure = errno;
  const ssize_t told = write(report, &failure, sizeof failure);
  _exit(told == sizeof failure ? 127 : 126);
}

}  // namespace

ChildOutcome RunChildProcess(const std::string& name, const std::vector<std::string>& words,
                             const fs::path& at, const fs::path& log, const ChildLimits& limits) {
  ChildOutcome outcome;
  const auto cannot = [&](const std::string& why) {
    outcome.failure = Error{ErrorKind::kEnvironment,
                            fmt::format("{}: '{}' cannot be run ({})", name, words[0], why)};
    return outcome;
  };
  std::vector<std::string> copies = words;
  std::vector<char*> argv;
  for (std::string& word : copies) argv.push_back(word.data());
  argv.push_back(nullptr);
  const std::string folder = at.string();

  const int log_file = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (log_file < 0) return cannot(fmt::format("{}: {}", log.string(), std::strerror(errno)));
  const int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
  std::array<int, 2> report{-1, -1};
  if (input < 0 || pipe2(report.data(), O_CLOEXEC) != 0) {
    const std::string why = std::strerror(errno);
    close(log_file);
    if (input >= 0) close(input);
    return cannot(why);
  }
  const auto start = Clock::now();
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) Become(argv.data(), folder.c_str(), log_file, input, report[1], parent);
  const int fork_failure = errno;
  close(log_file);
  close(input);
  close(report[1]);
  if (child < 0) {
    close(report[0]);
    return cannot(std::strerror(fork_failure));
  }
  setpgid(child, child);  // whoever is first
  int exec_failure = 0;
  ssize_t told = 0;
  do {
    told = read(report[0], &exec_failure, sizeof exec_failure);
  } while (told < 0 && errno == EINTR);
  close(report[0]);

  const auto elapsed = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };
  int status = 0;
  rusage usage{};
  double looked_s = -kMemoryLook_s;
  std::string killed_for;
  while (true) {
    // It is not reaped yet, so that its number still stands for its group below.
    siginfo_t ended{};
    const int asked = waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT);
    if ((asked == 0 && ended.si_pid == child) || (asked != 0 && errno != EINTR)) {
      break;
    }
    if (killed_for.empty() && elapsed() - looked_s >= kMemoryLook_s) {
      looked_s = elapsed();
      outcome.peak_bytes = std::max(outcome.peak_bytes, ResidentOfGroup(child));
      if (outcome.peak_bytes > limits.memory_bytes) {
        killed_for = fmt::format("took {:.0f} MB of memory, more than its limit of {:.0f} MB",
                                 static_cast<double>(outcome.peak_bytes) / 1e6,
                                 static_cast<double>(limits.memory_bytes) / 1e6);
      } else if (elapsed() > limits.time_s) {
        killed_for = fmt::format("ran longer than its limit of {:g} s", limits.time_s);
      }
      if (!killed_for.empty()) kill(-child, SIGKILL);
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(kExitLook_s));
  }
  kill(-child, SIGKILL);  // whatever it left running
  while (wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  outcome.wall_s = elapsed();
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  outcome.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  constexpr std::int64_t kKilo = 1024;  // of ru_maxrss
  outcome.peak_bytes = std::max(outcome.peak_bytes, kKilo * usage.ru_maxrss);
  if (told == sizeof exec_failure) return cannot(std::strerror(exec_failure));

  std::string how;
  if (!killed_for.empty()) {
    how = killed_for + ", and was ended";
  } else if (WIFSIGNALED(status)) {
    how = fmt::format("was ended by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  } else if (WEXITSTATUS(status) != 0) {
    how = fmt::format("ended with exit code {}", WEXITSTATUS(status));
  } else {
    return outcome;
  }
  const std::string said = EndOfLog(log);
  outcome.failure =
      Error{ErrorKind::kData,
            fmt::format("{}: {}{}", name, how,
                        said.empty() ? fmt::format(" (it said nothing in {})", log.string())
                                     : fmt::format("; {} ends with: {}", log.string(), said))};
  return outcome;
}

}  // namespace tsdfpp
