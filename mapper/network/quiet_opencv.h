// OpenCV without words of its own, on any thread.
#pragma once

namespace tsdfpp {

// While one lives, OpenCV prints neither what it throws nor its log. Unlike QuietStderr it holds
// nothing that another thread waits for: networks run for long. What others of the process hear of
// OpenCV meanwhile is as quiet; after the last one all is as it was before the first.
class QuietOpenCv {
 public:
  QuietOpenCv();
  ~QuietOpenCv();
  QuietOpenCv(const QuietOpenCv&) = delete;
  QuietOpenCv& operator=(const QuietOpenCv&) = delete;
};

}  // namespace tsdfpp
