#include "core/toml_reader.h"

#include <algorithm>
#include <cstdint>
#include <sstream>

#include "core/files.h"

namespace tsdfpp {
namespace {

// With its article, e.g. "an integer".
std::string TypeName(const toml::node& node) {
  std::ostringstream name;
  name << node.type();
  const std::string type = name.str() == "floating-point" ? "floating-point number" : name.str();
  return fmt::format("{} {}", type.find_first_of("aeiou") == 0 ? "an" : "a", type);
}

// Whether a string in it has more than one line.
bool HasLineEnd(const toml::node& node) {
  const auto has = [](const toml::node& inner) { return HasLineEnd(inner); };
  if (const auto* text = node.as_string()) return text->get().find('\n') != std::string::npos;
  if (const auto* array = node.as_array()) return std::any_of(array->begin(), array->end(), has);
  const auto* table = node.as_table();
  return table != nullptr && std::any_of(table->begin(), table->end(),
                                         [&](const auto& entry) { return has(entry.second); });
}

// A finite number, integer or float; nothing otherwise.
std::optional<double> Number(const toml::node& node) {
  if (!node.is_number()) return std::nullopt;
  const auto number = node.value<double>();
  if (!number || !std::isfinite(*number)) return std::nullopt;
  return number;
}

// Skips a string that begins at `at`: the place of its last quote, or the text's end.
std::size_t EndOfString(std::string_view text, std::size_t at) {
  const char quote = text[at];
  const std::string three(3, quote);
  const bool multiline = text.substr(at, 3) == three;
  for (std::size_t i = at + (multiline ? 3 : 1); i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
    } else if (multiline && text.substr(i, 3) == three) {
      // Up to two more are the string's own last characters.
      std::size_t last = i + 2;
      while (last < i + 4 && last + 1 < text.size() && text[last + 1] == quote) ++last;
      return last;
    } else if (!multiline && (text[i] == quote || text[i] == '\n')) {
      return i;
    }
  }
  return text.size();
}

// How deep tables and lists lie within one another, by brackets and by the dots of keys, within one
// header or one statement; toml++ itself bounds brackets only, and takes a place on the stack for
// each.
std::int64_t DepthOfToml(std::string_view text) {
  std::vector<std::int64_t> open;  // of each bracket the depth that it added
  std::int64_t depth = 0;
  std::int64_t dots = 0;
  std::int64_t deepest = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '#') {
      i = std::min(text.find('\n', i), text.size());
      dots = 0;
    } else if (c == '"' || c == '\'') {
      i = EndOfString(text, i);
    } else if (c == '.') {
      ++dots;
    } else if (c == '[' || c == '{') {
      open.push_back(dots + 1);
      depth += dots + 1;
      dots = 0;
    } else if (c == ']' || c == '}') {
      if (!open.empty()) {
        depth -= open.back();
        open.pop_back();
      }
      dots = 0;
    } else if (c == '\n' || c == ',') {
      dots = 0;
    }
    deepest = std::max(deepest, depth + dots);
  }
  return deepest;
}

}  // namespace

Expected<toml::table> ParseToml(std::string_view text, std::string_view name) {
  const auto shallow =
      CheckLimit(&Limits::nesting, DepthOfToml(text), name, "tables and lists within one another");
  if (!shallow) return UsageError("{}", shallow.error().message);
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    const auto& begin = error.source().begin;
    return UsageError("{}:{}:{}: not valid TOML: {}", name, begin.line, begin.column,
                      error.description());
  }
}

Expected<toml::table> ParseTomlFile(const std::filesystem::path& path) {
  auto text = ReadFile(path, &Limits::text_bytes);
  if (!text) return UsageError("{}", text.error().message);
  return ParseToml(*text, path.string());
}

std::string TomlText(const toml::table& table) {
  // What has no such string keeps the text that it always had: scenes are known by their text's
  // hash.
  auto flags = toml::toml_formatter::default_flags;
  if (HasLineEnd(table)) {
    flags &=
        ~(toml::format_flags::allow_multi_line_strings | toml::format_flags::allow_literal_strings);
  }
  std::ostringstream text;
  text << toml::toml_formatter(table, flags);
  return text.str();
}

TomlReader::TomlReader(const toml::table& table, std::string where, std::string path)
    : table_(table), where_(std::move(where)), path_(std::move(path)) {}

std::string TomlReader::PathOf(std::string_view key) const {
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

void TomlReader::Fault(std::string_view key, std::string_view sentence) {
  if (!fault_.empty()) return;
  const toml::node* node = table_.get(key);
  const auto line = node != nullptr ? node->source().begin.line : table_.source().begin.line;
  fault_ = line > 0 ? fmt::format("{}:{}: '{}' {}", where_, line, PathOf(key), sentence)
                    : fmt::format("{}: '{}' {}", where_, PathOf(key), sentence);
}

void TomlReader::WrongType(std::string_view key, const toml::node& node,
                           std::string_view expected) {
  const bool is_element = table_.get(key) != &node;
  Fault(key,
        fmt::format("{} {}, expected {}", is_element ? "holds" : "is", TypeName(node), expected));
}

const toml::node* TomlReader::Find(std::string_view key, bool required) {
  known_.emplace(key);
  const toml::node* node = table_.get(key);
  if (node == nullptr && required) Fault(key, "is missing");
  return node;
}

TomlReader& TomlReader::Get(std::string_view key, bool& value, bool required) {
  if (const toml::node* node = Find(key, required)) {
    if (node->is_boolean()) {
      value = node->as_boolean()->get();
    } else {
      WrongType(key, *node, "true or false");
    }
  }
  return *this;
}

TomlReader& TomlReader::Get(std::string_view key, int& value, bool required) {
  if (const toml::node* node = Find(key, required)) {
    const auto number = node->is_integer() ? node->value<int>() : std::nullopt;
    if (number) {
      value = *number;
    } else if (node->is_integer()) {
      Fault(key, fmt::format("is {}, too large for a whole number here", **node->as_integer()));
    } else {
      WrongType(key, *node, "a whole number");
    }
  }
  return *this;
}

TomlReader& TomlReader::Get(std::string_view key, std::int64_t& value, bool required) {
  if (const toml::node* node = Find(key, required)) {
    if (node->is_integer()) {
      value = node->as_integer()->get();
    } else {
      WrongType(key, *node, "a whole number");
    }
  }
  return *this;
}

TomlReader& TomlReader::Get(std::string_view key, double& value, bool required) {
  if (const toml::node* node = Find(key, required)) {
    if (const auto number = Number(*node)) {
      value = *number;
    } else if (node->is_number()) {
      Fault(key, "is not a finite number");
    } else {
      WrongType(key, *node, "a finite number");
    }
  }
  return *this;
}

TomlReader& TomlReader::Get(std::string_view key, std::string& value, bool required) {
  if (const toml::node* node = Find(key, required)) {
    if (node->is_string()) {
      value = node->as_string()->get();
    } else {
      WrongType(key, *node, "a string");
    }
  }
  return *this;
}

TomlReader& TomlReader::Get(std::string_view key, std::vector<double>& value, bool required) {
  if (const toml::node* node = Find(key, required)) {
    std::vector<double> numbers;
    const toml::array* array = node->as_array();
    if (array == nullptr) {
      WrongType(key, *node, "an array of numbers");
      return *this;
    }
    for (const toml::node& element : *array) {
      const auto number = Number(element);
      if (!number) {
        WrongType(key, element, "an array of finite numbers");
        return *this;
      }
      numbers.push_back(*number);
    }
    value = std::move(numbers);
  }
  return *this;
}

TomlReader& TomlReader::Get(std::string_view key, Eigen::Vector3d& value, bool required) {
  std::vector<double> numbers;
  Get(key, numbers, required);
  if (table_.get(key) == nullptr || !fault_.empty()) return *this;
  if (numbers.size() == 3) {
    value = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  } else {
    Fault(key, fmt::format("has {} numbers, expected 3", numbers.size()));
  }
  return *this;
}

TomlReader& TomlReader::Get(std::string_view key, std::vector<std::string>& value, bool required) {
  if (const toml::node* node = Find(key, required)) {
    std::vector<std::string> strings;
    const toml::array* array = node->as_array();
    if (array == nullptr) {
      WrongType(key, *node, "an array of strings");
      return *this;
    }
    for (const toml::node& element : *array) {
      if (!element.is_string()) {
        WrongType(key, element, "an array of strings");
        return *this;
      }
      strings.push_back(element.as_string()->get());
    }
    value = std::move(strings);
  }
  return *this;
}

const toml::table* TomlReader::Table(std::string_view key, bool required) {
  const toml::node* node = Find(key, required);
  if (node == nullptr) return nullptr;
  if (!node->is_table()) WrongType(key, *node, "a table");
  return node->as_table();
}

std::vector<const toml::table*> TomlReader::Tables(std::string_view key, bool required) {
  std::vector<const toml::table*> tables;
  const toml::node* node = Find(key, required);
  if (node == nullptr) return tables;
  const toml::array* array = node->as_array();
  if (array == nullptr || !array->is_array_of_tables()) {
    WrongType(key, *node, "an array of tables");
    return tables;
  }
  for (const toml::node& element : *array) tables.push_back(element.as_table());
  return tables;
}

Expected<void> TomlReader::Finish() {
  if (fault_.empty()) {
    for (const auto& [key, node] : table_) {
      if (!known_.contains(key.str())) {
        Fault(key.str(), "is not a known key here");
        break;
      }
    }
  }
  if (!fault_.empty()) return UsageError("{}", fault_);
  return {};
}

}  // namespace tsdfpp
