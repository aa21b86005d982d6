// Reads inputs of a target once, without a fuzzer: `replay TARGET FILE_OR_FOLDER...`, or `replay`
// for the names of the targets and `replay --sources` for the files whose lines they should reach.
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "core/files.h"
#include "core/folders.h"
#include "tests/fuzz/target.h"

namespace {

namespace fs = std::filesystem;
using namespace tsdfpp;

int List(bool with_sources) {
  for (const fuzz::Target& target : fuzz::AllTargets()) {
    std::string line(target.name);
    if (with_sources) {
      for (const std::string_view source : target.sources) line += " " + std::string(source);
    }
    std::printf("%s\n", line.c_str());
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return List(argc == 2 && std::string(argv[1]) == "--sources");
  const fuzz::Target* const target = fuzz::FindTarget(argv[1]);
  if (target == nullptr) {
    std::fprintf(stderr, "replay: there is no target '%s'\n", argv[1]);
    return 2;
  }
  std::vector<fs::path> files;
  for (int i = 2; i < argc; ++i) {
    std::vector<fs::path> more{argv[i]};
    if (IsFolder(argv[i])) more = EntriesOf(argv[i]);
    files.insert(files.end(), more.begin(), more.end());
  }
  // Before limits on what is read are those of the targets.
  std::vector<std::string> inputs;
  for (const fs::path& file : files) {
    const auto bytes = ReadFile(file);
    if (!bytes) {
      std::fprintf(stderr, "replay: %s\n", bytes.error().message.c_str());
      return 2;
    }
    inputs.push_back(*bytes);
  }
  fuzz::PrepareTargets();
  const auto accepted = std::count_if(
      inputs.begin(), inputs.end(), [&](const std::string& input) { return target->read(input); });
  std::printf("%s: %td of %zu inputs accepted\n", argv[1], accepted, inputs.size());
  return 0;
}
