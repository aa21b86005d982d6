// Strict TOML: every key is read with its type, and a key that nobody read is an error. And TOML as
// text that reads back as the same.
#pragma once

#include <toml++/toml.h>

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// Errors: kUsage, with file, line and column where the text is not TOML or the file is missing.
Expected<toml::table> ParseTomlFile(const std::filesystem::path& path);
Expected<toml::table> ParseToml(std::string_view text, std::string_view name);

// Of finite numbers and strings of any bytes that UTF-8 allows; ends without a newline. Where a
// string has several lines, all have escapes: toml++ puts it between quotes that may be in it.
std::string TomlText(const toml::table& table);

// Reads one table. Getters leave `value` untouched where the key is absent (so it keeps its
// default) unless `required`. The first fault is kept, and Finish() returns it; Finish() also names
// unknown keys. The table must outlive the reader.
class TomlReader {
 public:
  // `where` is the file's name, `path` the dotted path of this table ("" at the root).
  TomlReader(const toml::table& table, std::string where, std::string path = "");

  TomlReader& Get(std::string_view key, bool& value, bool required = false);
  TomlReader& Get(std::string_view key, int& value, bool required = false);
  TomlReader& Get(std::string_view key, std::int64_t& value, bool required = false);
  TomlReader& Get(std::string_view key, double& value, bool required = false);
  TomlReader& Get(std::string_view key, std::string& value, bool required = false);
  TomlReader& Get(std::string_view key, Eigen::Vector3d& value, bool required = false);
  TomlReader& Get(std::string_view key, std::vector<double>& value, bool required = false);
  TomlReader& Get(std::string_view key, std::vector<std::string>& value, bool required = false);

  // The sub-table, or nullptr where absent (a fault where required).
  const toml::table* Table(std::string_view key, bool required = false);
  // The tables of an array of tables, [[key]].
  std::vector<const toml::table*> Tables(std::string_view key, bool required = false);

  // Records a fault of the caller's own, e.g. "must be positive", for this key.
  void Fault(std::string_view key, std::string_view sentence);
  std::string PathOf(std::string_view key) const;
  const std::string& where() const { return where_; }

  Expected<void> Finish();

 private:
  const toml::node* Find(std::string_view key, bool required);
  void WrongType(std::string_view key, const toml::node& node, std::string_view expected);

  const toml::table& table_;
  std::string where_;
  std::string path_;
  std::set<std::string, std::less<>> known_;
  std::string fault_;
};

}  // namespace tsdfpp
