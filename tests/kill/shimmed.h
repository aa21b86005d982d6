// Programs that are killed, or whose disk is full, at their k-th change of a folder (shim.c).
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tsdfpp::test {

struct Ending {
  int exit_code = -1;  // -1 where a signal ended it
  int signal = 0;
  std::string err;
};

// What is done to a program: `how` as shim.c has it, at the `at`-th change below `below`.
struct Fault {
  std::filesystem::path below;
  int at = 0;  // 0: nothing happens
  std::string how = "kill";
};

// Waits for the end. stdout, stderr and the shim's count are files in `scratch`.
Ending RunShimmed(const std::vector<std::string>& words, const Fault& fault,
                  const std::filesystem::path& scratch);

// How many changes the program made that was run last with this `scratch`.
int Changes(const std::filesystem::path& scratch);

// The bytes of all files below a folder by their paths in it, hidden ones too; what is no file is
// "a link", "a folder" (an empty one) or "odd".
std::map<std::string, std::string> ContentOf(const std::filesystem::path& folder);

}  // namespace tsdfpp::test
