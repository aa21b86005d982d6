#include "core/late_library.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <string>

#include "core/decode_image.h"
#include "core/encode_image.h"

namespace tsdfpp {
namespace {

TEST(LateLibrary, SaysWhatIsNotThere) {
  const auto no_library = LateFunction("libtsdfpp_no_such.so", "TsdfppImageCodecs");
  ASSERT_FALSE(no_library.has_value());
  EXPECT_EQ(no_library.error().kind, ErrorKind::kEnvironment);
  EXPECT_NE(no_library.error().message.find("'libtsdfpp_no_such.so' cannot be loaded"),
            std::string::npos)
      << no_library.error().message;
  const auto no_function = LateFunction("libtsdfpp_image_codecs.so", "NoSuchFunction");
  ASSERT_FALSE(no_function.has_value());
  EXPECT_NE(no_function.error().message.find("NoSuchFunction"), std::string::npos)
      << no_function.error().message;
}

TEST(LateLibrary, EncodesWhatItDecodes) {
  cv::Mat image(3, 5, CV_8UC3);
  cv::randu(image, 0, 256);
  const auto bytes = EncodeImage(image, ".png", "a test");
  ASSERT_TRUE(bytes.has_value()) << bytes.error().message;
  const auto decoded = DecodeImage(*bytes, "a test");
  ASSERT_TRUE(decoded.has_value()) << decoded.error().message;
  EXPECT_EQ(cv::norm(image, *decoded, cv::NORM_INF), 0);
}

}  // namespace
}  // namespace tsdfpp
