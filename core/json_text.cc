#include "core/json_text.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/files.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kMostShownJson = 100;

// How deep lists and objects lie within one another, whatever else is wrong with the text.
std::int64_t DepthOf(std::string_view text) {
  std::int64_t depth = 0;
  std::int64_t deepest = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      deepest = std::max(deepest, ++depth);
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return deepest;
}

// Looks through a text for an object that names a member twice, of which the library would take the
// last one in silence. A pass of its own: what the library parses with a callback takes time with
// the square of a list's objects.
class MemberNames : public nlohmann::json_sax<nlohmann::json> {
 public:
  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_object(std::size_t) override {
    open_.emplace_back();
    return true;
  }
  bool key(string_t& name) override {
    if (!twice_ && !open_.back().insert(name).second) twice_ = name;
    return true;
  }
  bool end_object() override {
    open_.pop_back();
    return true;
  }
  bool start_array(std::size_t) override { return true; }
  bool end_array() override { return true; }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

  // The first name that is there twice.
  const std::optional<std::string>& twice() const { return twice_; }

 private:
  std::vector<std::set<std::string>> open_;  // of the objects that are open
  std::optional<std::string> twice_;
};

// What the text holds; discarded where it is no JSON. Errors: too much of it, or an object that
// names a member twice.
Expected<nlohmann::json> ParseWithinLimits(std::string_view text, std::string_view where) {
  TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::json_bytes, static_cast<std::int64_t>(text.size()),
                                    where, "bytes of JSON"));
  TSDFPP_RETURN_IF_ERROR(
      CheckLimit(&Limits::nesting, DepthOf(text), where, "lists and objects within one another"));
  MemberNames names;
  if (!nlohmann::json::sax_parse(text, &names)) {
    return nlohmann::json(nlohmann::json::value_t::discarded);
  }
  if (names.twice()) {
    return DataError("{}: an object has {} twice", where, Quoted(*names.twice()));
  }
  return nlohmann::json::parse(text, nullptr, false);
}

template <typename Json>
std::string TextOfJson(const Json& value, int indent) {
  return value.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

Expected<nlohmann::json> ParseJson(std::string_view text, std::string_view where) {
  TSDFPP_ASSIGN(nlohmann::json value, ParseWithinLimits(text, where));
  if (value.is_discarded()) return DataError("{}: not JSON", where);
  return value;
}

Expected<nlohmann::json> ParseJsonObject(std::string_view text, std::string_view where) {
  TSDFPP_ASSIGN(nlohmann::json value, ParseWithinLimits(text, where));
  if (!value.is_object()) return DataError("{}: not a JSON object", where);
  return value;
}

Expected<nlohmann::json> ReadJsonObject(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path, &Limits::json_bytes));
  return ParseJsonObject(text, path.string());
}

std::string JsonText(const nlohmann::json& value, int indent) { return TextOfJson(value, indent); }

std::string JsonText(const nlohmann::ordered_json& value, int indent) {
  return TextOfJson(value, indent);
}

std::string JsonShown(const nlohmann::json& value) {
  return OneLine(JsonText(value), kMostShownJson);
}

Expected<void> CheckTextsAreShowable(const nlohmann::json& value, std::string_view where) {
  const auto check = [&](const std::string& text) -> Expected<void> {
    if (IsShowable(text)) return {};
    return DataError("{}: the text {} holds control characters, expected none", where,
                     Quoted(text));
  };
  if (value.is_string()) return check(value.get_ref<const std::string&>());
  if (value.is_object()) {
    for (const auto& [name, member] : value.items()) {
      TSDFPP_RETURN_IF_ERROR(check(name));
      TSDFPP_RETURN_IF_ERROR(CheckTextsAreShowable(member, where));
    }
  } else if (value.is_array()) {
    for (const nlohmann::json& element : value) {
      TSDFPP_RETURN_IF_ERROR(CheckTextsAreShowable(element, where));
    }
  }
  return {};
}

std::optional<std::int64_t> WholeIn(const nlohmann::json& value, std::int64_t lowest,
                                    std::int64_t highest) {
  if (!value.is_number_integer()) return std::nullopt;
  constexpr auto kMost = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  if (value.is_number_unsigned() && value.get<std::uint64_t>() > kMost) return std::nullopt;
  const auto number = value.get<std::int64_t>();
  if (number < lowest || number > highest) return std::nullopt;
  return number;
}

}  // namespace tsdfpp
