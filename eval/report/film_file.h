// A film while it is written: whole at its place, or not at all.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/quiet_stderr.h"
#include "eval/report/film_encoder.h"

namespace tsdfpp {

// Whether the bytes are an MP4 file from its beginning to its end, with its index.
bool IsWholeVideo(std::string_view bytes);

// A file in memory that a library can open by a name: it says nothing where it could not write.
class MemoryFile {
 public:
  MemoryFile();
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  bool is_open() const { return descriptor_ >= 0; }
  int failure() const { return failure_; }  // as errno
  // Errors: kEnvironment.
  Expected<std::string> Read() const;
  std::string path() const;

 private:
  int descriptor_;
  int failure_;
};

// OpenCV does not say whether what it wrote got anywhere, so it writes to memory. It knows the
// format by the name's end, so a link beside the file has one, until the film is done. While it is
// open nothing else of this process gets to stderr, since the encoder's threads print there.
class FilmFile {
 public:
  explicit FilmFile(const std::filesystem::path& file);
  ~FilmFile();
  FilmFile(const FilmFile&) = delete;
  FilmFile& operator=(const FilmFile&) = delete;

  // Errors: kEnvironment, the folder refuses or there is no encoder.
  Expected<void> Open(cv::Size size, int rate_hz);
  // Both after an Open that went well; a page is blue, green, red, and of the film's size.
  void Show(const cv::Mat& page);
  // Errors: kEnvironment, the film is not whole or cannot be written.
  Expected<void> Finish();
  int frames() const { return frames_; }

 private:
  tl::unexpected<Error> Cannot(const std::string& why) const;

  std::filesystem::path file_;
  MemoryFile memory_;
  std::filesystem::path link_;
  std::optional<QuietStderr> quiet_;  // outlives the encoder's threads
  std::unique_ptr<FilmEncoder> encoder_;
  int frames_ = 0;
};

}  // namespace tsdfpp
