#include "eval/adapters/supervisor.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <ctime>

#include "core/own_environment.h"

namespace tsdfpp {
namespace {

constexpr int kTick_ms = 10;
constexpr double kPatience_s = 10;

double SteadyNow_s() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Closes all descriptors above the standard ones but `kept`: a lock of ours must not live on in a
// process that outlives us.
void CloseAllBut(std::array<int, 6> kept) {
  std::sort(kept.begin(), kept.end());
  unsigned first = STDERR_FILENO + 1;
  for (const int descriptor : kept) {
    if (descriptor < static_cast<int>(first)) continue;
    const auto number = static_cast<unsigned>(descriptor);
    if (number > first) close_range(first, number - 1, 0);
    first = number + 1;
  }
  close_range(first, ~0U, 0);
}

// The program itself.
[[noreturn]] void Become(const SupervisedProgram& program, pid_t supervisor, int failure_to) {
  // A group of its own, so that what it does to its group does not meet the supervisor.
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != supervisor) _exit(1);
  for (const int signal : {SIGINT, SIGTERM, SIGPIPE}) std::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  rlimit file{};
  if (getrlimit(RLIMIT_FSIZE, &file) == 0) {
    file.rlim_cur = std::min(file.rlim_max, static_cast<rlim_t>(program.file_bytes));
    file.rlim_max = file.rlim_cur;
    setrlimit(RLIMIT_FSIZE, &file);
  }
  // Without a group the looks at /proc are what there is.
  if (program.enter_group >= 0) {
    [[maybe_unused]] const ssize_t entered = write(program.enter_group, "0", 1);
  }
  if (dup2(program.input, STDIN_FILENO) >= 0 && dup2(program.output, STDOUT_FILENO) >= 0 &&
      dup2(program.output, STDERR_FILENO) >= 0 && chdir(program.at) == 0) {
    close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
    TakeOutOwn(environ);
    execvp(program.words[0], program.words);
  }
  const int failure = errno;
  const ssize_t told = write(failure_to, &failure, sizeof failure);
  _exit(told == sizeof failure ? 127 : 126);
}

// The errno with which it could not be run; 0 where it runs.
int StartProgram(const SupervisedProgram& program, pid_t& child) {
  std::array<int, 2> failure{-1, -1};
  if (pipe2(failure.data(), O_CLOEXEC) != 0) return errno;
  const pid_t supervisor = getpid();
  child = fork();
  if (child == 0) Become(program, supervisor, failure[1]);
  const int fork_failure = errno;
  close(failure[1]);
  if (child < 0) {
    close(failure[0]);
    return fork_failure;
  }
  int exec_failure = 0;
  ssize_t told = 0;
  do {
    told = read(failure[0], &exec_failure, sizeof exec_failure);
  } while (told < 0 && errno == EINTR);
  close(failure[0]);
  return told == sizeof exec_failure ? exec_failure : 0;
}

// What passes a limit now, if anything does.
EndedFor Look(const SupervisedProgram& program, ProcessTree& tree, SupervisorReport& report) {
  std::int64_t pages = 0;
  std::int64_t processes = 0;
  for (const TreeProcess& process : tree.Look(getpid())) {
    pages += process.resident_pages;
    ++processes;
  }
  report.peak_bytes = std::max(report.peak_bytes, pages * sysconf(_SC_PAGESIZE));
  report.most_processes = std::max(report.most_processes, processes);
  if (report.peak_bytes > program.memory_bytes) return EndedFor::kMemory;
  if (processes > program.processes) return EndedFor::kProcesses;
  return EndedFor::kNothing;
}

// Takes note of whatever has ended; true where the program itself has.
bool HasEnded(pid_t child, int& status) {
  bool ended = false;
  while (true) {
    int how = 0;
    const pid_t process = waitpid(-1, &how, WNOHANG);
    if (process < 0 && errno == EINTR) continue;
    if (process <= 0) return ended || (process < 0 && errno == ECHILD);
    if (process != child) continue;
    status = how;
    ended = true;
  }
}

void Watch(const SupervisedProgram& program, pid_t parent, pid_t child, ProcessTree& tree,
           SupervisorReport& report) {
  const double start_s = SteadyNow_s();
  double next_look_s = 0;
  while (!HasEnded(child, report.status)) {
    const double now_s = SteadyNow_s() - start_s;
    if (now_s >= next_look_s) {
      report.ended_for = Look(program, tree, report);
      if (report.ended_for != EndedFor::kNothing) return;
      next_look_s = now_s + kLook_s;
    }
    if (now_s > program.time_s) {
      report.ended_for = EndedFor::kTime;
      return;
    }
    pollfd order{program.control, POLLIN, 0};
    const bool ordered = poll(&order, 1, kTick_ms) > 0;
    // Where a brother of ours holds the pipe, too, it stays open when the parent dies.
    if (ordered || getppid() != parent) {
      report.ended_for = EndedFor::kOrder;
      return;
    }
  }
}

}  // namespace

void Supervise(const SupervisedProgram& program, pid_t parent, ProcessTree& tree) {
  // Out of the terminal's reach, and of signals: it ends with the parent, and after the program.
  setsid();
  sigset_t all;
  sigfillset(&all);
  sigprocmask(SIG_SETMASK, &all, nullptr);
  std::signal(SIGCHLD, SIG_DFL);  // an inherited SIG_IGN would hide how children end
  prctl(PR_SET_PDEATHSIG, 0);
  prctl(PR_SET_CHILD_SUBREAPER, 1);
  prctl(PR_SET_NAME, "tsdfpp-watch");
  CloseAllBut({program.input, program.output, program.control, program.report, program.enter_group,
               program.end_group});
  SupervisorReport report;
  pid_t child = -1;
  const double start_s = SteadyNow_s();
  report.exec_failure = StartProgram(program, child);
  // The log ends when the last of the program's processes has.
  close(program.output);
  if (report.exec_failure == 0) Watch(program, parent, child, tree, report);
  if (program.end_group >= 0) {
    [[maybe_unused]] const ssize_t told = write(program.end_group, "1", 1);
  }
  if (child > 0) kill(-child, SIGKILL);  // where /proc cannot be read, this group at least
  report.all_ended = tree.EndAllBelowThis(kPatience_s);
  if (program.group != nullptr) rmdir(program.group);
  report.wall_s = SteadyNow_s() - start_s;
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  report.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  constexpr std::int64_t kKilo = 1024;  // of ru_maxrss
  report.most_bytes = kKilo * usage.ru_maxrss;
  const ssize_t told = write(program.report, &report, sizeof report);
  _exit(told == sizeof report ? 0 : 1);
}

}  // namespace tsdfpp
