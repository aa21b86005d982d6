// A log of what another program says, of which head and tail are kept where it says too much.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/error.h"

namespace tsdfpp {

class CappedLog {
 public:
  // Makes the file, or empties it. Half of `most_bytes` is kept of the beginning and half of the
  // end. Errors: kEnvironment.
  static Expected<CappedLog> Open(const std::filesystem::path& path, std::int64_t most_bytes);
  ~CappedLog();
  CappedLog(CappedLog&& other) noexcept;
  CappedLog& operator=(CappedLog&&) = delete;

  void Add(std::string_view bytes);
  // Writes the tail behind a line that says how much is left out. Errors: kEnvironment where the
  // disk has refused any of it.
  Expected<void> Finish();

  std::int64_t bytes() const { return bytes_; }
  // The last line that says anything, of kLastLine_bytes at most (its end, behind "..."). What
  // cannot be printed, or is no UTF-8, is a '?'.
  std::string LastLine() const;

 private:
  CappedLog(std::filesystem::path path, int file, std::size_t half)
      : path_(std::move(path)), file_(file), half_(half) {}
  void Write(std::string_view bytes);

  std::filesystem::path path_;
  int file_;
  std::size_t half_;
  std::size_t head_ = 0;    // bytes written of the beginning
  std::string tail_;        // up to twice half_ of what came behind
  std::string last_;        // of the end, for LastLine
  std::int64_t bytes_ = 0;  // in all
  std::int64_t dropped_ = 0;
  int failure_ = 0;  // errno of the first write that failed
};

inline constexpr std::size_t kLastLine_bytes = 200;

}  // namespace tsdfpp
