// OpenCV's encoder of films, in a library of its own that is loaded with the first film.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "core/error.h"

namespace tsdfpp {

class FilmEncoder {
 public:
  virtual ~FilmEncoder() = default;
  // Begins a film in H.264 at `file`, whose name says its format; false where that cannot be.
  virtual bool Open(const std::string& file, int rate_hz, cv::Size size) = 0;
  virtual void Write(const cv::Mat& page) = 0;  // blue, green, red
  virtual void Close() = 0;
};

// Errors: kEnvironment, the library cannot be loaded.
Expected<std::unique_ptr<FilmEncoder>> NewFilmEncoder();

}  // namespace tsdfpp
