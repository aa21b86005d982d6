// What eval/report/film_encoder.h loads.
#include <opencv2/videoio.hpp>

#include "eval/report/film_encoder.h"

namespace tsdfpp {
namespace {

class OpenCvEncoder : public FilmEncoder {
 public:
  bool Open(const std::string& file, int rate_hz, cv::Size size) override {
    writer_.open(file, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'), rate_hz, size);
    return writer_.isOpened();
  }
  void Write(const cv::Mat& page) override { writer_.write(page); }
  void Close() override { writer_.release(); }

 private:
  cv::VideoWriter writer_;
};

}  // namespace
}  // namespace tsdfpp

extern "C" tsdfpp::FilmEncoder* TsdfppNewFilmEncoder();

tsdfpp::FilmEncoder* TsdfppNewFilmEncoder() { return new tsdfpp::OpenCvEncoder; }
