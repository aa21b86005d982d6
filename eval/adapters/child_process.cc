#include "eval/adapters/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <utility>

#include "eval/adapters/capped_log.h"
#include "eval/adapters/control_group.h"
#include "eval/adapters/supervisor.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kMega = 1e6;

// A descriptor that closes itself.
class OpenEnd {
 public:
  explicit OpenEnd(int descriptor = -1) : descriptor_(descriptor) {}
  ~OpenEnd() { Close(); }
  OpenEnd(const OpenEnd&) = delete;
  OpenEnd& operator=(const OpenEnd&) = delete;
  int get() const { return descriptor_; }
  void Reset(int descriptor) {
    Close();
    descriptor_ = descriptor;
  }
  void Close() {
    if (descriptor_ >= 0) close(std::exchange(descriptor_, -1));
  }

 private:
  int descriptor_;
};

struct PipeEnds {
  OpenEnd out;
  OpenEnd in;
  bool Make() {
    std::array<int, 2> ends{-1, -1};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) return false;
    out.Reset(ends[0]);
    in.Reset(ends[1]);
    return true;
  }
};

// What runs between us, the supervisor and its program. The program says, the supervisor reports,
// and it ends all once we let go of its control.
struct Lines {
  OpenEnd input;
  PipeEnds said;
  PipeEnds reported;
  PipeEnds control;

  // False where it cannot be had, as errno says.
  bool Open() {
    input.Reset(open("/dev/null", O_RDONLY | O_CLOEXEC));
    return input.get() >= 0 && said.Make() && reported.Make() && control.Make() &&
           fcntl(said.out.get(), F_SETFL, O_NONBLOCK) == 0;
  }

  // After the fork: what is the supervisor's to hold.
  void CloseTheirs() {
    said.in.Close();
    reported.in.Close();
    control.out.Close();
  }
};

std::int64_t OwnResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  std::int64_t size = 0;
  std::int64_t resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

// Disk that the files below a folder take; links are not followed.
std::int64_t DiskBytes(const fs::path& folder) {
  constexpr std::int64_t kBlock = 512;  // of st_blocks
  std::int64_t bytes = 0;
  std::error_code failure;
  for (fs::recursive_directory_iterator
           entry(folder, fs::directory_options::skip_permission_denied, failure),
       end;
       !failure && entry != end; entry.increment(failure)) {
    struct stat file {};
    if (lstat(entry->path().c_str(), &file) == 0) bytes += kBlock * file.st_blocks;
  }
  return bytes;
}

// Reads what is there. False at the end of the pipe.
bool Drain(int pipe, CappedLog& log, int most_reads) {
  std::array<char, 65536> block{};
  for (int i = 0; i < most_reads; ++i) {
    const ssize_t count = read(pipe, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno == EAGAIN;
    if (count == 0) return false;
    log.Add({block.data(), static_cast<std::size_t>(count)});
  }
  return true;
}

// What a supervisor needs from us while the program runs, and what came of it.
struct Attendance {
  std::optional<SupervisorReport> report;
  std::string ended_for;  // what we had it ended for
};

// A program that stops its supervisor would never meet its limits: it goes on, and where it comes
// to no report even so, it is ended.
void KeepAwake(pid_t supervisor, bool is_late) {
  siginfo_t state{};
  if (waitid(P_PID, static_cast<id_t>(supervisor), &state, WSTOPPED | WNOHANG) == 0 &&
      state.si_pid == supervisor) {
    kill(supervisor, SIGCONT);
  }
  if (is_late) kill(supervisor, SIGKILL);
}

// Takes the program's words into the log and looks at its disk until the supervisor reports.
Attendance Attend(pid_t supervisor, Lines& lines, const fs::path& folder, const ChildLimits& limits,
                  const ControlGroup* group, CappedLog& log) {
  constexpr double kToReport_s = 30;  // to end all that was started, on a busy machine
  constexpr int kWait_ms = 100;
  constexpr std::chrono::seconds kDiskLook{1};
  constexpr int kReads = 16;
  Attendance attendance;
  bool said_all = false;
  auto next_look = Clock::now() + kDiskLook;
  const auto begin = Clock::now();
  while (true) {
    std::array<pollfd, 2> ends{pollfd{lines.reported.out.get(), POLLIN, 0},
                               pollfd{said_all ? -1 : lines.said.out.get(), POLLIN, 0}};
    poll(ends.data(), ends.size(), kWait_ms);
    if (ends[1].revents != 0) said_all = !Drain(lines.said.out.get(), log, kReads);
    if (ends[0].revents != 0) {
      SupervisorReport report;
      const ssize_t told = read(lines.reported.out.get(), &report, sizeof report);
      if (told < 0 && errno == EINTR) continue;
      if (told == sizeof report) attendance.report = report;
      // More than a pipe holds can only come from a process that could not be ended.
      if (!said_all) Drain(lines.said.out.get(), log, kReads);
      return attendance;
    }
    // In doubles: a limit may be more than the clock can count.
    const std::chrono::duration<double> passed = Clock::now() - begin;
    KeepAwake(supervisor, passed.count() > limits.time_s + kToReport_s);
    if (lines.control.in.get() < 0 || Clock::now() < next_look) continue;
    const std::int64_t disk = DiskBytes(folder);
    next_look = Clock::now() + kDiskLook;
    if (disk > limits.disk_bytes) {
      attendance.ended_for = fmt::format(
          "wrote {:.0f} MB to its folder, more than its limit of {:.0f} MB",
          static_cast<double>(disk) / kMega, static_cast<double>(limits.disk_bytes) / kMega);
    } else if (group != nullptr && group->RanOutOfMemory()) {
      attendance.ended_for = fmt::format("took more memory than its limit of {:.0f} MB",
                                         static_cast<double>(limits.memory_bytes) / kMega);
    }
    if (!attendance.ended_for.empty()) lines.control.in.Close();
  }
}

// How the program ended where that is a failure, else "".
std::string HowItEnded(const SupervisorReport& report, const ChildLimits& limits) {
  switch (report.ended_for) {
    case EndedFor::kTime:
      return fmt::format("ran longer than its limit of {:g} s, and was ended", limits.time_s);
    case EndedFor::kMemory:
      return fmt::format(
          "took {:.0f} MB of memory, more than its limit of {:.0f} MB, and was ended",
          static_cast<double>(report.peak_bytes) / kMega,
          static_cast<double>(limits.memory_bytes) / kMega);
    case EndedFor::kProcesses:
      return fmt::format("had {} processes at once, more than its limit of {}, and was ended",
                         report.most_processes, limits.processes);
    case EndedFor::kOrder:
      return "was ended";
    case EndedFor::kNothing:
      break;
  }
  if (WIFSIGNALED(report.status)) {
    const int signal = WTERMSIG(report.status);
    std::string how = fmt::format("was ended by signal {} ({})", signal, strsignal(signal));
    if (signal == SIGXFSZ) {
      how += fmt::format(": a file may have {:.0f} MB",
                         static_cast<double>(limits.disk_bytes) / kMega);
    }
    return how;
  }
  if (WEXITSTATUS(report.status) != 0) {
    return fmt::format("ended with exit code {}", WEXITSTATUS(report.status));
  }
  if (!report.all_ended) return "left processes behind that cannot be ended";
  return "";
}

// How the program ended where that is a failure, else "".
std::string HowItEnded(const Attendance& attendance, const ChildLimits& limits,
                       const ControlGroup* group) {
  if (!attendance.report) {
    return "ended the process that watches it; what it started may still run";
  }
  if (!attendance.ended_for.empty()) return attendance.ended_for + ", and was ended";
  if (group != nullptr && group->RanOutOfMemory()) {
    return fmt::format("took more memory than its limit of {:.0f} MB, and was ended",
                       static_cast<double>(limits.memory_bytes) / kMega);
  }
  return HowItEnded(*attendance.report, limits);
}

// What it used, as far as the supervisor saw.
void TakeFigures(const SupervisorReport& report, std::int64_t at_fork_bytes,
                 ChildOutcome& outcome) {
  outcome.wall_s = report.wall_s;
  outcome.cpu_s = report.cpu_s;
  outcome.most_processes = report.most_processes;
  outcome.peak_bytes = report.peak_bytes;
  // The kernel's own figure counts what we had at the fork as the program's.
  constexpr std::int64_t kMargin = 16'000'000;
  if (report.peak_bytes == 0 || report.most_bytes > at_fork_bytes + kMargin) {
    outcome.peak_bytes = std::max(report.peak_bytes, report.most_bytes);
  }
}

// What the program said last, as the end of a sentence.
std::string LastWords(const CappedLog& log, const std::string& shown_log) {
  const std::string last = log.LastLine();
  if (last.empty()) return fmt::format(" (it said nothing in {})", shown_log);
  return fmt::format("; {} ends with: {}", shown_log, last);
}

std::optional<ControlGroup> MakeGroup(const ChildLimits& limits) {
  constexpr std::int64_t kThreadsAProcess = 64;
  const auto parent = limits.control_group ? WritableControlGroup() : std::nullopt;
  if (!parent) return std::nullopt;
  return ControlGroup::Make(*parent, limits.memory_bytes, kThreadsAProcess * limits.processes);
}

// The words of a command as exec takes them.
class Words {
 public:
  explicit Words(std::vector<std::string> words) : words_(std::move(words)) {
    for (std::string& word : words_) argv_.push_back(word.data());
    argv_.push_back(nullptr);
  }
  Words(const Words&) = delete;
  Words& operator=(const Words&) = delete;
  char** argv() { return argv_.data(); }

 private:
  std::vector<std::string> words_;
  std::vector<char*> argv_;
};

// What the supervisor is told, but for the command and its folder.
SupervisedProgram ProgramUnder(const ChildLimits& limits, const Lines& lines,
                               const std::optional<ControlGroup>& group) {
  SupervisedProgram program;
  program.input = lines.input.get();
  program.output = lines.said.in.get();
  program.control = lines.control.out.get();
  program.report = lines.reported.in.get();
  if (group) {
    program.enter_group = group->enter();
    program.end_group = group->end_all();
    program.group = group->path().c_str();
  }
  program.time_s = limits.time_s;
  program.memory_bytes = limits.memory_bytes;
  program.processes = limits.processes;
  program.file_bytes = limits.disk_bytes;
  return program;
}

void WaitFor(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
}

void EndAll(const ControlGroup& group) {
  if (group.end_all() < 0) return;
  [[maybe_unused]] const ssize_t told = write(group.end_all(), "1", 1);
}

}  // namespace

ChildOutcome RunChildProcess(const std::string& name, const std::vector<std::string>& words,
                             const fs::path& at, const fs::path& log_path,
                             const ChildLimits& limits, const fs::path& shown_log) {
  ChildOutcome outcome;
  const auto cannot = [&](const std::string& why) {
    outcome.failure = Error{ErrorKind::kEnvironment,
                            fmt::format("{}: '{}' cannot be run ({})", name, words[0], why)};
    return outcome;
  };
  auto log = CappedLog::Open(log_path, limits.log_bytes);
  if (!log) return cannot(log.error().message);
  Lines lines;
  if (!lines.Open()) return cannot(std::strerror(errno));
  const std::optional<ControlGroup> group = MakeGroup(limits);
  Words arguments(words);
  const std::string folder = at.string();
  SupervisedProgram program = ProgramUnder(limits, lines, group);
  program.words = arguments.argv();
  program.at = folder.c_str();

  ProcessTree tree;  // before the fork, after which nothing may be allocated
  const std::int64_t at_fork_bytes = OwnResidentBytes();
  const pid_t parent = getpid();
  const pid_t supervisor = fork();
  if (supervisor == 0) Supervise(program, parent, tree);
  if (supervisor < 0) return cannot(std::strerror(errno));
  lines.CloseTheirs();
  const Attendance attendance =
      Attend(supervisor, lines, at, limits, group ? &*group : nullptr, *log);
  lines.control.in.Close();
  WaitFor(supervisor);

  const auto logged = log->Finish();
  outcome.log_bytes = log->bytes();
  if (attendance.report) {
    if (const int failure = attendance.report->exec_failure; failure != 0) {
      return cannot(std::strerror(failure));
    }
    TakeFigures(*attendance.report, at_fork_bytes, outcome);
  } else if (group) {
    EndAll(*group);
  }
  const std::string how = HowItEnded(attendance, limits, group ? &*group : nullptr);
  if (!how.empty()) {
    const std::string shown = (shown_log.empty() ? log_path : shown_log).string();
    outcome.failure = Error{ErrorKind::kData, name + ": " + how + LastWords(*log, shown)};
  } else if (!logged) {
    outcome.failure = logged.error();
  }
  return outcome;
}

std::string ChildControl() {
  std::error_code failure;
  const bool proc = fs::exists("/proc/self/stat", failure);
  const std::string group = ControlGroupAbilities();
  return fmt::format("{}{}",
                     proc ? "a watching process that adopts orphans and finds all through /proc"
                          : "a watching process without /proc: nobody is found or counted",
                     group.empty() ? "; no control group (cgroup 2) may be made here"
                                   : fmt::format("; a control group that {}", group));
}

}  // namespace tsdfpp
