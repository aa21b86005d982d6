#include "eval/run/workers.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "core/guard.h"
#include "core/last_words.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

constexpr const char* kDone = "done";
constexpr const char* kError = "error ";  // followed by the kind, a blank and the sentence

// In the child; never returns.
[[noreturn]] void RunChild(const Workers::Body& body, int descriptor, pid_t parent) {
  // The parent alone decides what a signal of the terminal means; if it dies, so does the child.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_DFL);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
  SpeakAs(nullptr);
  Channel channel(descriptor);
  // What is thrown must not unwind the parent's frames, of which this process has a copy.
  const Expected<void> result = Guarded([&] { return body(channel); });
  if (result) {
    channel.Send(kDone);
  } else {
    channel.Send(fmt::format("{}{} {}", kError, static_cast<int>(result.error().kind),
                             OneLine(result.error().message)));
  }
  std::fflush(nullptr);
  // Without the destructors of what the parent shares.
  _exit(result ? 0 : 1);
}

}  // namespace

bool Channel::Send(const std::string& line) {
  const std::string bytes = line + "\n";
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t count = send(descriptor_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    sent += static_cast<std::size_t>(count);
  }
  return true;
}

bool Channel::Fill() {
  std::array<char, 4096> block{};
  const ssize_t count = recv(descriptor_, block.data(), block.size(), 0);
  if (count < 0 && errno == EINTR) return true;
  if (count <= 0) return false;
  buffer_.append(block.data(), static_cast<std::size_t>(count));
  return true;
}

std::optional<std::string> Channel::TakeLine() {
  const std::size_t end = buffer_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  std::string line = buffer_.substr(0, end);
  buffer_.erase(0, end + 1);
  return line;
}

std::optional<std::string> Channel::Receive() {
  while (true) {
    if (auto line = TakeLine()) return line;
    if (!Fill()) return std::nullopt;
  }
}

Expected<Workers> Workers::Start(int count, const Body& body) {
  Workers workers;
  const pid_t parent = getpid();
  std::fflush(nullptr);
  for (int i = 0; i < count; ++i) {
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
      return EnvironmentError("no connection to a worker process ({})", std::strerror(errno));
    }
    const pid_t process = fork();
    if (process == 0) {
      close(ends[0]);
      for (const Child& other : workers.children_) close(other.channel.descriptor());
      RunChild(body, ends[1], parent);
    }
    close(ends[1]);
    if (process < 0) {
      close(ends[0]);
      return EnvironmentError("no worker process ({})", std::strerror(errno));
    }
    workers.children_.push_back({process, Channel(ends[0]), false});
  }
  return workers;
}

Workers::Workers(Workers&& other) noexcept : children_(std::move(other.children_)) {
  other.children_.clear();
}

Workers::~Workers() {
  for (Child& child : children_) {
    if (child.process > 0) kill(child.process, SIGKILL);
    if (child.channel.descriptor() >= 0) close(child.channel.descriptor());
  }
  for (Child& child : children_) {
    if (child.process > 0) waitpid(child.process, nullptr, 0);
  }
}

int Workers::running() const {
  return static_cast<int>(std::count_if(children_.begin(), children_.end(),
                                        [](const Child& child) { return child.process > 0; }));
}

void Workers::Send(int worker, const std::string& line) {
  // A child that is gone is met by Next().
  children_[static_cast<std::size_t>(worker)].channel.Send(line);
}

void Workers::Close(int worker) {
  shutdown(children_[static_cast<std::size_t>(worker)].channel.descriptor(), SHUT_WR);
}

Expected<void> Workers::Reap(Child& child) {
  int status = 0;
  while (waitpid(child.process, &status, 0) < 0 && errno == EINTR) {
  }
  child.process = -1;
  close(child.channel.descriptor());
  child.channel = Channel(-1);
  if (child.finished) return {};
  if (WIFSIGNALED(status)) {
    return EnvironmentError("a worker process was ended by signal {} ({})", WTERMSIG(status),
                            strsignal(WTERMSIG(status)));
  }
  if (WEXITSTATUS(status) == static_cast<int>(ErrorKind::kEnvironment)) {
    return EnvironmentError("a worker process ended for want of memory, or of a file");
  }
  return EnvironmentError("a worker process ended with exit code {}", WEXITSTATUS(status));
}

Expected<std::optional<Workers::Message>> Workers::Next() {
  while (running() > 0) {
    for (std::size_t i = 0; i < children_.size(); ++i) {
      Child& child = children_[i];
      const auto line = child.channel.TakeLine();
      if (!line) continue;
      if (*line == kDone) {
        child.finished = true;
      } else if (line->starts_with(kError)) {
        const std::string rest = line->substr(std::strlen(kError));
        const int kind = rest.empty() ? 0 : rest.front() - '0';
        const bool known = kind >= static_cast<int>(ErrorKind::kUsage) &&
                           kind <= static_cast<int>(ErrorKind::kInternal);
        const std::size_t blank = rest.find(' ');
        return tl::unexpected(Error{known ? static_cast<ErrorKind>(kind) : ErrorKind::kInternal,
                                    blank == std::string::npos
                                        ? "a worker process failed without a word"
                                        : rest.substr(blank + 1)});
      } else {
        return Message{static_cast<int>(i), *line};
      }
    }
    std::vector<pollfd> waiting;
    std::vector<std::size_t> whose;
    for (std::size_t i = 0; i < children_.size(); ++i) {
      if (children_[i].process <= 0) continue;
      waiting.push_back({children_[i].channel.descriptor(), POLLIN, 0});
      whose.push_back(i);
    }
    constexpr int kForever = -1;
    if (poll(waiting.data(), waiting.size(), kForever) < 0) {
      if (errno == EINTR) return std::nullopt;
      return EnvironmentError("no news from the worker processes ({})", std::strerror(errno));
    }
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      if (waiting[i].revents == 0) continue;
      Child& child = children_[whose[i]];
      if (!child.channel.Fill()) TSDFPP_RETURN_IF_ERROR(Reap(child));
    }
  }
  return std::nullopt;
}

}  // namespace tsdfpp
