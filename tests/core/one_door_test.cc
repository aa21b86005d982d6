// Some things have one way in: text becomes JSON, and bytes become pixels, in one place each, where
// the limits are.
#include <gtest/gtest.h>

#include <filesystem>

#include "core/files.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

TEST(OneDoor, NobodyElseCallsTheLibraries) {
  struct Rule {
    const char* call;
    const char* door;
  };
  constexpr Rule kRules[] = {{"json::parse(", "core/json_text.cc"},
                             {"Json::parse(", "core/json_text.cc"},
                             {".dump(", "core/json_text.cc"},
                             {"->dump(", "core/json_text.cc"},
                             {"cv::imread(", "core/image_codecs_module.cc"},
                             {"cv::imdecode(", "core/image_codecs_module.cc"},
                             {"cv::imencode(", "core/image_codecs_module.cc"},
                             {"codecs->read(", "core/decode_image.cc"},
                             {"codecs->decode(", "core/decode_image.cc"},
                             {"toml::parse(", "core/toml_reader.cc"},
                             {"toml::parse_file(", "core/toml_reader.cc"}};
  const fs::path root = TSDFPP_SOURCE_DIR;
  int files = 0;
  for (const char* room :
       {"core", "sim", "sequence", "mapper", "metrics", "eval", "cli", "bench"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / room)) {
      const std::string ending = entry.path().extension().string();
      if (ending != ".cc" && ending != ".h") continue;
      const std::string file = entry.path().lexically_relative(root).string();
      const auto text = ReadFile(entry.path());
      ASSERT_TRUE(text.has_value()) << text.error().message;
      ++files;
      for (const Rule& rule : kRules) {
        const bool calls = text->find(rule.call) != std::string::npos;
        EXPECT_TRUE(!calls || file == rule.door)
            << file << " calls " << rule.call << "...), which " << rule.door << " is for";
      }
    }
  }
  EXPECT_GT(files, 300);
}

}  // namespace
}  // namespace tsdfpp
