#include "bench/peer_process.h"

#include <fcntl.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>

namespace tsdfpp {
namespace {

constexpr const char* kEndOfTurn = "end of turn\t";

// This process's variables with those of OpenMP.
std::vector<std::string> Variables(OpenMpWait wait, int threads) {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (std::strncmp(*variable, "OMP_", 4) != 0) variables.emplace_back(*variable);
  }
  variables.push_back(
      fmt::format("OMP_WAIT_POLICY={}", wait == OpenMpWait::kActive ? "active" : "passive"));
  variables.push_back(fmt::format("OMP_NUM_THREADS={}", threads));
  return variables;
}

std::vector<char*> Pointers(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

Expected<std::unique_ptr<PeerProcess>> PeerProcess::Start(const std::vector<std::string>& arguments,
                                                          OpenMpWait wait, int threads) {
  std::vector<std::string> words{"tsdfpp_bench", "peers"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<std::string> variables = Variables(wait, threads);
  std::signal(SIGPIPE, SIG_IGN);  // a process that has ended is an error below, not our end
  std::unique_ptr<PeerProcess> peer(new PeerProcess);
  std::array<int, 2> to{};
  std::array<int, 2> from{};
  if (pipe2(to.data(), O_CLOEXEC) != 0) return EnvironmentError("no pipe to Open3D's process");
  peer->to_ = fdopen(to[1], "w");
  if (pipe2(from.data(), O_CLOEXEC) != 0) {
    close(to[0]);
    return EnvironmentError("no pipe from Open3D's process");
  }
  peer->from_ = fdopen(from[0], "r");
  posix_spawn_file_actions_t ends;
  posix_spawn_file_actions_init(&ends);
  posix_spawn_file_actions_adddup2(&ends, to[0], STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&ends, from[1], STDOUT_FILENO);
  const int failure = posix_spawn(&peer->process_, "/proc/self/exe", &ends, nullptr,
                                  Pointers(words).data(), Pointers(variables).data());
  posix_spawn_file_actions_destroy(&ends);
  close(to[0]);
  close(from[1]);
  if (failure != 0) {
    peer->process_ = -1;
    return EnvironmentError("cannot start Open3D's process ({})", std::strerror(failure));
  }
  return peer;
}

PeerProcess::~PeerProcess() {
  if (process_ > 0) {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  if (to_ != nullptr) std::fclose(to_);
  if (from_ != nullptr) std::fclose(from_);
}

Expected<std::vector<PeerTimes>> PeerProcess::IntegrateNext() {
  kill(process_, SIGCONT);
  std::fputs("next\n", to_);
  std::fflush(to_);
  std::vector<PeerTimes> all;
  char* line = nullptr;
  std::size_t capacity = 0;
  bool ended = false;
  while (!ended && getline(&line, &capacity, from_) > 0) {
    const std::string said(line);
    const std::size_t tab = said.find('\t');
    if (tab == std::string::npos) continue;  // Open3D's own messages
    ended = said.starts_with(kEndOfTurn);
    if (ended) continue;
    std::istringstream numbers(said.substr(tab));
    PeerTimes times{said.substr(0, tab), 0, {}};
    numbers >> times.bytes;
    for (double ms = 0; numbers >> ms;) times.ms.push_back(ms);
    all.push_back(std::move(times));
  }
  std::free(line);
  kill(process_, SIGSTOP);
  if (!ended) return EnvironmentError("Open3D's process ended before its last frame");
  return all;
}

void SayPeerTimes(const PeerTimes& times) {
  fmt::print("{}\t{} {}\n", times.name, times.bytes, fmt::join(times.ms, " "));
}

void EndPeerTurn() {
  fmt::print("{}\n", kEndOfTurn);
  std::fflush(stdout);
}

bool AwaitPeerTurn() {
  // Who has started us might end while we are stopped.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (int c = std::getchar(); c != EOF; c = std::getchar()) {
    if (c == '\n') return true;
  }
  return false;
}

}  // namespace tsdfpp
