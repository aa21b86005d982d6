#include "core/encode_image.h"

#include "core/image_codecs.h"

namespace tsdfpp {

Expected<std::string> EncodeImage(const cv::Mat& image, const std::string& ending,
                                  const std::string& where, const std::vector<int>& parameters) {
  const auto codecs = LoadImageCodecs();
  if (!codecs) return EnvironmentError("{}: {}", where, codecs.error().message);
  std::vector<unsigned char> bytes;
  if (!codecs->encode(ending, image, bytes, parameters)) {
    return EnvironmentError("{}: {}x{} pixels cannot be encoded as '{}'", where, image.cols,
                            image.rows, ending);
  }
  return std::string(bytes.begin(), bytes.end());
}

}  // namespace tsdfpp
