// What is installed of the mapper (mapper/public_headers.txt) is whole, and no more than that.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "core/files.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

const fs::path kSource = TSDFPP_SOURCE_DIR;

// At the mapper's top and not installed: how a map answers the mapper itself, in types of its
// rooms.
const std::map<std::string, std::string> kPrivate{
    {"mapper/block_moves.h", "asked by CheckReach(), for whoever has poses"},
    {"mapper/block_surfaces.h", "asked by SceneMesher, for whoever wants meshes"},
    {"mapper/map_persistence.h", "asked by SaveMap() and LoadMap(), for whoever has a file"},
};
constexpr std::size_t kAboutADozen = 14;

using Headers = std::set<std::string>;

struct Installed {
  Headers face;    // the list's first part
  Headers needed;  // its second part
  Headers all;
};

Installed InstalledHeaders() {
  std::istringstream lines(ReadFile(kSource / "mapper/public_headers.txt").value());
  Installed headers;
  bool is_face = true;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# Included by them")) is_face = false;
    if (line.empty() || line[0] == '#') continue;
    EXPECT_TRUE(headers.all.insert(line).second) << line << " is there twice";
    (is_face ? headers.face : headers.needed).insert(line);
  }
  return headers;
}

// What the pattern's first group matches in the text.
Headers FoundIn(const std::string& text, const char* pattern) {
  const std::regex regex(pattern);
  Headers found;
  for (std::sregex_iterator at(text.begin(), text.end(), regex), end; at != end; ++at) {
    found.insert((*at)[1]);
  }
  return found;
}

std::string TextOf(const fs::path& file) { return ReadFile(kSource / file).value(); }

Headers MapperHeadersIn(const std::string& header) {
  return FoundIn(TextOf(header), "#include \"(mapper/[^\"]+)\"");
}

bool LiesAtTheTop(const std::string& header) {
  return fs::path(header).parent_path() == fs::path("mapper");
}

Headers HeadersAtTheTop() {
  Headers headers;
  for (const auto& entry : fs::directory_iterator(kSource / "mapper")) {
    const fs::path name = entry.path().filename();
    if (name.extension() == ".h") headers.insert("mapper/" + name.string());
  }
  return headers;
}

TEST(PublicHeaders, IncludeEachOtherAlone) {
  const Installed installed = InstalledHeaders();
  ASSERT_FALSE(installed.all.empty());
  for (const std::string& header : installed.all) {
    ASSERT_TRUE(fs::exists(kSource / header)) << header;
    for (const std::string& included : MapperHeadersIn(header)) {
      EXPECT_TRUE(installed.all.contains(included)) << header << " includes " << included;
    }
  }
}

TEST(PublicHeaders, AreAFaceAndWhatItNeeds) {
  const Installed installed = InstalledHeaders();
  Headers needed;
  for (const std::string& header : installed.all) needed.merge(MapperHeadersIn(header));
  for (const std::string& header : installed.needed) EXPECT_TRUE(needed.contains(header)) << header;
  for (const std::string& header : installed.face) EXPECT_TRUE(LiesAtTheTop(header)) << header;
  EXPECT_LE(installed.face.size(), kAboutADozen);
}

TEST(PublicHeaders, EveryOneAtTheTopIsPublicOrPrivateForAReason) {
  const Installed installed = InstalledHeaders();
  const Headers at_the_top = HeadersAtTheTop();
  for (const std::string& header : at_the_top) {
    EXPECT_NE(installed.all.contains(header), kPrivate.contains(header)) << header;
  }
  for (const auto& [header, reason] : kPrivate) {
    EXPECT_TRUE(at_the_top.contains(header)) << header;
  }
}

// So that whoever has the installed headers finds what they speak of.
TEST(PublicHeaders, TheFaceNamesWhatIsInstalled) {
  const Installed installed = InstalledHeaders();
  for (const std::string& header : installed.face) {
    for (const std::string& named : FoundIn(TextOf(header), "(mapper/[a-z_/-]+\\.h)")) {
      EXPECT_TRUE(installed.all.contains(named)) << header << " names " << named;
    }
  }
}

TEST(PublicHeaders, ThePageOfTheArchitectureNamesTheFace) {
  const std::string page = TextOf("docs/architecture.md");
  const std::size_t begin = page.find("`mapper/public_headers.txt` names");
  ASSERT_NE(begin, std::string::npos);
  const std::string paragraph = page.substr(begin, page.find("\n\n", begin) - begin);
  EXPECT_EQ(FoundIn(paragraph, "`(mapper/[a-z_]+\\.h)`"), InstalledHeaders().face);
}

}  // namespace
}  // namespace tsdfpp
