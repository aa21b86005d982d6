// Runs the built command (TSDFPP_COMMAND) as a user would.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tsdfpp::test {

// The command's exit codes (docs/command-line.md), on purpose not taken from its own header.
inline constexpr int kUsage = 2;
inline constexpr int kEnvironment = 3;
inline constexpr int kData = 4;

struct CommandOutput {
  int exit_code = -1;  // -1 where it did not end by itself
  std::string out;
  std::string err;
};

// Waits for the end. `variables` are set in the child's environment. stdout and stderr are files in
// `scratch`, so neither is a terminal.
CommandOutput RunTsdfpp(const std::vector<std::string>& arguments,
                        const std::filesystem::path& scratch,
                        const std::map<std::string, std::string>& variables = {});

}  // namespace tsdfpp::test
