// Child processes that work side by side, each with libraries and an OpenGL context of its own:
// software renderers in one process fight over their threads (docs/sources.md, "Renderers side by
// side").
#pragma once

#include <sys/types.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// One end of a connection that carries lines.
class Channel {
 public:
  explicit Channel(int descriptor) : descriptor_(descriptor) {}
  // False where the other end is gone. `line` without an end of line.
  bool Send(const std::string& line);
  // Waits; nothing where the other end is gone.
  std::optional<std::string> Receive();

  int descriptor() const { return descriptor_; }
  // What has arrived, without waiting: false where the other end is gone.
  bool Fill();
  std::optional<std::string> TakeLine();

 private:
  int descriptor_;
  std::string buffer_;
};

class Workers {
 public:
  // What a child does; its error is passed on to the parent.
  using Body = std::function<Expected<void>(Channel&)>;

  // Forks `count` children. Call it while the process has one thread: before rendering, and before
  // anything runs in parallel. A child ends with its parent. Errors: kEnvironment.
  static Expected<Workers> Start(int count, const Body& body);
  // Ends the children that still work.
  ~Workers();
  Workers(Workers&&) noexcept;
  Workers& operator=(Workers&&) = delete;

  struct Message {
    int worker = 0;
    std::string line;
  };
  // The next line from any child; nothing where all have ended well, or a signal came in between
  // (look at `running` then). Errors: the child's own; kEnvironment where a child died.
  Expected<std::optional<Message>> Next();
  void Send(int worker, const std::string& line);
  // Tells the child that nothing more will come.
  void Close(int worker);
  int running() const;

 private:
  struct Child {
    pid_t process = -1;
    Channel channel{-1};
    bool finished = false;  // said so
  };
  Workers() = default;
  Expected<void> Reap(Child& child);
  std::vector<Child> children_;
};

}  // namespace tsdfpp
