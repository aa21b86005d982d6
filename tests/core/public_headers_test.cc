// What is installed of the mapper (mapper/public_headers.txt) is whole, and no more than that.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "core/files.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

const fs::path kSource = TSDFPP_SOURCE_DIR;

std::set<std::string> PublicHeaders() {
  std::istringstream lines(ReadFile(kSource / "mapper/public_headers.txt").value());
  std::set<std::string> headers;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line[0] != '#') headers.insert(line);
  }
  return headers;
}

std::set<std::string> MapperHeadersIn(const std::string& header) {
  const std::string text = ReadFile(kSource / header).value();
  const std::regex include("#include \"(mapper/[^\"]+)\"");
  std::set<std::string> included;
  for (std::sregex_iterator at(text.begin(), text.end(), include), end; at != end; ++at) {
    included.insert((*at)[1]);
  }
  return included;
}

bool LiesAtTheTop(const std::string& header) {
  return fs::path(header).parent_path() == fs::path("mapper");
}

TEST(PublicHeaders, IncludeEachOtherAlone) {
  const std::set<std::string> headers = PublicHeaders();
  ASSERT_FALSE(headers.empty());
  for (const std::string& header : headers) {
    ASSERT_TRUE(fs::exists(kSource / header)) << header;
    for (const std::string& included : MapperHeadersIn(header)) {
      EXPECT_TRUE(headers.contains(included)) << header << " includes " << included;
    }
  }
}

TEST(PublicHeaders, BelowTheTopThoseAreInstalledThatAreNeeded) {
  std::set<std::string> needed;
  for (const std::string& header : PublicHeaders()) needed.merge(MapperHeadersIn(header));
  for (const std::string& header : PublicHeaders()) {
    EXPECT_TRUE(LiesAtTheTop(header) || needed.contains(header)) << header;
  }
}

}  // namespace
}  // namespace tsdfpp
