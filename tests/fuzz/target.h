// What is fuzzed: each reader of files as a function of one input.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tsdfpp::fuzz {

struct Target {
  std::string_view name;
  // Of a target that reads one file its name, by whose ending inputs are changed; empty where the
  // input is a set of files (file_set.h).
  std::string_view file;
  // Reads the input as the program would. Returns whether it was accepted. Complains (complaint.h)
  // about what must never be; whatever else ends the process is a find, too.
  bool (*read)(std::string_view input);
  // Whose lines the coverage of the target is of, relative to the repository.
  std::vector<std::string_view> sources;
};

// All, by name.
const std::vector<Target>& AllTargets();
// nullptr where there is none of this name.
const Target* FindTarget(std::string_view name);

// Sets limits under which an input cannot ask for much memory, and silences the log.
void PrepareTargets();

// The targets, file by file.
void AddSequenceTargets(std::vector<Target>& targets);
void AddMeshTargets(std::vector<Target>& targets);
void AddMapTargets(std::vector<Target>& targets);
void AddConfigTargets(std::vector<Target>& targets);
void AddResultTargets(std::vector<Target>& targets);
void AddTextTargets(std::vector<Target>& targets);

}  // namespace tsdfpp::fuzz
