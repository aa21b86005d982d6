// The one way from text to JSON and back. nlohmann's own copies, prints and destroys with a place
// on the stack for each level, looks through all members for each that it adds to an ordered
// object (which is written here, therefore, and not read), wraps numbers that do not fit, and
// throws for text that is not UTF-8.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/limits.h"

namespace tsdfpp {

// What the text holds. `where` begins the sentence. Errors: kData where it is no JSON, over the
// limits of size and nesting (core/limits.h), or an object names a member twice.
Expected<nlohmann::json> ParseJson(std::string_view text, std::string_view where);

// The same, of a JSON object: "<where>: not a JSON object" covers what is no JSON, too.
Expected<nlohmann::json> ParseJsonObject(std::string_view text, std::string_view where);

// A file with a JSON object. Errors: also those of ReadFile.
Expected<nlohmann::json> ReadJsonObject(const std::filesystem::path& path);

// As text, on one line or indented by blanks. Bytes that are not UTF-8 become U+FFFD.
std::string JsonText(const nlohmann::json& value, int indent = -1);
std::string JsonText(const nlohmann::ordered_json& value, int indent = -1);

// A value for a message: at most 100 bytes of its text.
std::string JsonShown(const nlohmann::json& value);

// Whether all texts in the value, names of members too, are fit to be shown (core/one_line.h).
// Errors: kData, naming the first that is not; `where` begins the sentence.
Expected<void> CheckTextsAreShowable(const nlohmann::json& value, std::string_view where);

// The whole number from `lowest` to `highest`; nothing where the value is another.
std::optional<std::int64_t> WholeIn(const nlohmann::json& value, std::int64_t lowest,
                                    std::int64_t highest);

}  // namespace tsdfpp
