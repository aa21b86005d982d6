// Changes of inputs that keep their form, so that a fuzzer gets behind checksums, compression,
// counts and syntax: sets of files are changed file by file, JSON value by value, TOML and text by
// lines and words, saved maps section by section, glTF, klg and PNG files part by part.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <string_view>

namespace tsdfpp::fuzz {

// Bytes changed without regard to their form: what a fuzzer has of its own.
using ChangeBytes = std::function<std::string(const std::string& bytes)>;

class Mutator {
 public:
  Mutator(std::uint32_t seed, ChangeBytes change_bytes)
      : random_(seed), change_bytes_(std::move(change_bytes)) {}

  // An input of a set of files (file_set.h).
  std::string ChangeSet(std::string_view input);
  // An input with entries of both.
  std::string CrossSets(std::string_view first, std::string_view second);
  // The bytes of a file of this name.
  std::string ChangeFile(std::string_view name, const std::string& bytes);

 private:
  std::size_t Below(std::size_t count) { return count == 0 ? 0 : random_() % count; }
  bool OneIn(std::size_t count) { return Below(count) == 0; }
  std::string ChangePath(const std::string& path);
  std::string ChangeText(const std::string& text);
  std::string ChangeJson(const std::string& text);
  std::string ChangeMap(const std::string& bytes);
  std::string ChangeGlb(const std::string& bytes);
  std::string ChangeKlg(const std::string& bytes);
  std::string ChangePng(const std::string& bytes);
  std::string SomeWord();

  std::minstd_rand random_;
  ChangeBytes change_bytes_;
};

}  // namespace tsdfpp::fuzz
