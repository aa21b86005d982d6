// Silence for libraries that print their own words where ours belong.
#pragma once

#include <mutex>

namespace tsdfpp {

// OpenCV and the codecs below it print their own words about a damaged image to stderr, and offer
// no hook. While this lives, what the process prints there is dropped; a second one waits for the
// first.
class QuietStderr {
 public:
  QuietStderr();
  ~QuietStderr();
  QuietStderr(const QuietStderr&) = delete;
  QuietStderr& operator=(const QuietStderr&) = delete;

 private:
  std::lock_guard<std::mutex> lock_;  // two at once would restore each other's silence
  int saved_;
};

}  // namespace tsdfpp
