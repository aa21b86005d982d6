// What core/image_codecs.h loads.
#include <opencv2/imgcodecs.hpp>

#include "core/image_codecs.h"

extern "C" void TsdfppImageCodecs(tsdfpp::ImageCodecs* codecs);

void TsdfppImageCodecs(tsdfpp::ImageCodecs* codecs) {
  codecs->read = [](const std::string& path, int flags) { return cv::imread(path, flags); };
  codecs->decode = [](const cv::Mat& bytes, int flags) { return cv::imdecode(bytes, flags); };
  codecs->encode = [](const std::string& ending, const cv::Mat& image,
                      std::vector<unsigned char>& bytes, const std::vector<int>& parameters) {
    return cv::imencode(ending, image, bytes, parameters);
  };
}
