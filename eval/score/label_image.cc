#include "eval/score/label_image.h"

#include "core/decode_image.h"

namespace tsdfpp {

Expected<cv::Mat> ReadNumbers(const std::filesystem::path& path, bool rgb_id) {
  TSDFPP_ASSIGN(const cv::Mat image, ReadImageFile(path, DecodeAs::kNumbers));
  cv::Mat numbers;
  if (!rgb_id && (image.type() == CV_8UC1 || image.type() == CV_16UC1)) {
    image.convertTo(numbers, CV_32SC1);
    return numbers;
  }
  if (image.type() != CV_8UC3) {
    return DataError("{}: has {} channels of {} bytes, expected {}", path.string(),
                     image.channels(), image.elemSize1(),
                     rgb_id ? "8-bit RGB ids" : "8-bit or 16-bit grey");
  }
  numbers.create(image.size(), CV_32SC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const auto& bgr = image.at<cv::Vec3b>(y, x);
      if (!rgb_id && (bgr[0] != bgr[1] || bgr[1] != bgr[2])) {
        return DataError("{}: pixel {},{} has a colour, expected a grey label", path.string(), x,
                         y);
      }
      numbers.at<std::int32_t>(y, x) = rgb_id ? bgr[2] + 256 * bgr[1] + 65536 * bgr[0] : bgr[0];
    }
  }
  return numbers;
}

}  // namespace tsdfpp
