#include "core/guard.h"

#include <atomic>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>

#include "core/address_space.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

constexpr const char* kOutOfMemory = "out of memory: what was asked for needs more than there is";

// Whether a library's words for what it threw are those of Open3D, or of the system, for a piece of
// memory that was too large; what is smaller may still be had.
bool SaysOutOfMemory(std::string_view words) {
  return words.find("malloc failed") != std::string_view::npos ||
         words.find("Cannot allocate memory") != std::string_view::npos;
}

}  // namespace

Error ErrorOfException() {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return {ErrorKind::kEnvironment, kOutOfMemory};
  } catch (const std::filesystem::filesystem_error& error) {
    return {ErrorKind::kEnvironment,
            fmt::format("{}: {}", error.path1().string(), error.code().message())};
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) return {ErrorKind::kEnvironment, kOutOfMemory};
    return {ErrorKind::kInternal, fmt::format("internal error, in OpenCV: {}", error.err)};
  } catch (const std::exception& error) {
    // Libraries have their own words for it.
    if (IsOutOfAddressSpace() || SaysOutOfMemory(error.what())) {
      return {ErrorKind::kEnvironment, kOutOfMemory};
    }
    return {ErrorKind::kInternal, fmt::format("internal error: {}", error.what())};
  } catch (...) {
    return {ErrorKind::kInternal, "internal error"};
  }
}

namespace {
std::atomic<int> stderr_descriptor = 2;
}  // namespace

int StderrDescriptor() { return stderr_descriptor; }
void SetStderrDescriptor(int descriptor) { stderr_descriptor = descriptor; }

void PrintError(std::string_view program, std::string_view message) {
  dprintf(StderrDescriptor(), "%s: %s\n", std::string(program).c_str(), OneLine(message).c_str());
}

}  // namespace tsdfpp
