#include "core/one_line.h"

#include <fmt/format.h>

#include <algorithm>

namespace tsdfpp {
namespace {

constexpr std::string_view kGap = " ... ";

// Of a control character at the front: its bytes; 0 where there is none.
std::size_t ControlLength(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x20 || byte(0) == 0x7F) return 1;
  // U+0080 to U+009F.
  if (text.size() > 1 && byte(0) == 0xC2 && byte(1) >= 0x80 && byte(1) < 0xA0) return 2;
  return 0;
}

bool IsContinuation(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80; }

}  // namespace

std::size_t Utf8Length(std::string_view text) {
  if (text.empty()) return 0;
  const auto byte = [&](std::size_t i) -> unsigned {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  std::size_t length = 0;
  // The second byte's range keeps overlong forms, surrogates and what is beyond U+10FFFF out.
  unsigned low = 0x80;
  unsigned high = 0xBF;
  if (first >= 0xC2 && first <= 0xDF) {
    length = 2;
  } else if (first >= 0xE0 && first <= 0xEF) {
    length = 3;
    if (first == 0xE0) low = 0xA0;
    if (first == 0xED) high = 0x9F;
  } else if (first >= 0xF0 && first <= 0xF4) {
    length = 4;
    if (first == 0xF0) low = 0x90;
    if (first == 0xF4) high = 0x8F;
  } else {
    return 0;
  }
  if (byte(1) < low || byte(1) > high) return 0;
  for (std::size_t i = 2; i < length; ++i) {
    if (byte(i) < 0x80 || byte(i) > 0xBF) return 0;
  }
  return length;
}

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = Utf8Length(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

bool HasControl(std::string_view text) {
  for (; !text.empty(); text.remove_prefix(1)) {
    if (ControlLength(text) > 0) return true;
  }
  return false;
}

bool IsShowable(std::string_view text) { return IsUtf8(text) && !HasControl(text); }

std::string OneLine(std::string_view text, std::size_t most) {
  std::string line;
  line.reserve(text.size());
  // What is cut out of the middle need not be looked at; an escaped byte takes at most four.
  const std::string whole =
      text.size() <= 4 * most
          ? std::string()
          : fmt::format("{}{}", text.substr(0, 2 * most), text.substr(text.size() - 2 * most));
  if (!whole.empty()) text = whole;
  while (!text.empty()) {
    const std::size_t control = ControlLength(text);
    std::size_t length = control > 0 ? control : Utf8Length(text);
    if (control == 1 && (text.front() == '\n' || text.front() == '\t')) {
      line += ' ';
    } else if (control > 0 || length == 0) {
      length = std::max<std::size_t>(length, 1);
      for (const char c : text.substr(0, length)) {
        line += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
      }
    } else {
      line += text.substr(0, length);
    }
    text.remove_prefix(length);
  }
  if (line.size() <= most) return line;
  if (most <= kGap.size()) return {};
  const std::size_t kept = most - kGap.size();
  std::size_t head = (kept + 1) / 2;
  while (head > 0 && IsContinuation(line[head])) --head;
  std::size_t tail = line.size() - kept / 2;
  while (tail < line.size() && IsContinuation(line[tail])) ++tail;
  return line.substr(0, head) + std::string(kGap) + line.substr(tail);
}

std::string InMarkdown(std::string_view text) {
  std::string escaped;
  for (const char c : OneLine(text)) {
    if (std::string_view("\\|<>[]`*&!").find(c) != std::string_view::npos) escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string_view WithoutTag(std::string_view words) {
  const std::size_t end = words.find("] ");
  return words.starts_with("[json.") && end != std::string_view::npos ? words.substr(end + 2)
                                                                      : words;
}

std::string Quoted(std::string_view text) {
  constexpr std::size_t kMostShown = 100;
  return "'" + OneLine(text, kMostShown) + "'";
}

}  // namespace tsdfpp
