// Silence for libraries that print their own words where ours belong.
#pragma once

#include <mutex>
#include <string>

namespace tsdfpp {

// OpenCV and the codecs below it print their own words about a damaged image, or a lack of memory,
// to stderr, and offer no hook; nor does the compiler within a software renderer. While this lives,
// what the process prints there is kept from it. A second one waits for another thread's; of one
// thread the last ends first.
class QuietStderr {
 public:
  QuietStderr();
  ~QuietStderr();
  QuietStderr(const QuietStderr&) = delete;
  QuietStderr& operator=(const QuietStderr&) = delete;

  // What was printed so far; nothing where the machine refused to keep it.
  std::string Words() const;

 private:
  std::lock_guard<std::recursive_mutex> lock_;  // two at once would restore each other's silence
  int saved_;
  int words_;       // where they go
  int before_ = 2;  // StderrDescriptor()
};

}  // namespace tsdfpp
