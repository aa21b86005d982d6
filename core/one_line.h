// Text from outside made fit to be shown: one line of UTF-8 without control bytes.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tsdfpp {

// The most bytes that a message has.
inline constexpr std::size_t kMostMessageBytes = 480;

// The length of the UTF-8 character that `text` begins with: 1 to 4 bytes, 0 where these bytes are
// none (cut off, overlong, a surrogate, beyond U+10FFFF).
std::size_t Utf8Length(std::string_view text);

// Whether all of it is UTF-8.
bool IsUtf8(std::string_view text);

// Whether it holds a control character: C0 (tabs and line ends too), DEL or, as UTF-8, C1.
bool HasControl(std::string_view text);

// Whether it is UTF-8 without control characters: what OneLine() leaves as it is.
bool IsShowable(std::string_view text);

// The text with each control byte and each byte that is not UTF-8 written as \xNN, a line end and a
// tab as a blank. What is over `most` bytes then loses its middle, for which " ... " stands;
// characters stay whole. Text that is fine is returned as it is.
std::string OneLine(std::string_view text, std::size_t most = kMostMessageBytes);

// The text in one line, with nothing in it that Markdown or a browser would read as more than text:
// for a table's cell.
std::string InMarkdown(std::string_view text);

// What nlohmann's exceptions say, without the name that they begin with: "[json.exception...] ".
std::string_view WithoutTag(std::string_view words);

// A name or value found in a file, in single quotes, at most 100 bytes of it.
std::string Quoted(std::string_view text);

}  // namespace tsdfpp
