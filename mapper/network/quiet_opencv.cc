#include "mapper/network/quiet_opencv.h"

#include <mutex>
#include <opencv2/core/utility.hpp>
#include <opencv2/core/utils/logger.hpp>

namespace tsdfpp {
namespace {

// Of the process, as OpenCV's settings are.
struct Quiet {
  std::mutex mutex;
  int count = 0;
  cv::utils::logging::LogLevel level = cv::utils::logging::LOG_LEVEL_WARNING;
  cv::ErrorCallback callback = nullptr;
  void* userdata = nullptr;
};

Quiet& TheQuiet() {
  static Quiet quiet;
  return quiet;
}

int SayNothing(int /*status*/, const char* /*function*/, const char* /*message*/,
               const char* /*file*/, int /*line*/, void* /*userdata*/) {
  return 0;
}

}  // namespace

QuietOpenCv::QuietOpenCv() {
  Quiet& quiet = TheQuiet();
  const std::lock_guard lock(quiet.mutex);
  if (quiet.count++ > 0) return;
  quiet.level = cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  quiet.callback = cv::redirectError(SayNothing, nullptr, &quiet.userdata);
}

QuietOpenCv::~QuietOpenCv() {
  Quiet& quiet = TheQuiet();
  const std::lock_guard lock(quiet.mutex);
  if (--quiet.count > 0) return;
  cv::utils::logging::setLogLevel(quiet.level);
  cv::redirectError(quiet.callback, quiet.userdata, nullptr);
}

}  // namespace tsdfpp
