#include "cli/command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <string_view>

#include "core/data_folder.h"

namespace tsdfpp {
namespace {

// All of the text as a finite number.
std::optional<double> FiniteNumber(const std::string& text) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(number)) return std::nullopt;
  return number;
}

// "010": to CLI11 it is 8, to others 10.
bool BeginsWithZero(std::string_view text) {
  const std::size_t at = text.find_first_of("0123456789");
  return at != std::string_view::npos && text[at] == '0' && at + 1 < text.size() &&
         text[at + 1] >= '0' && text[at + 1] <= '9';
}

constexpr const char* kNoZeros = ", without a 0 before it";

CLI::Validator Number(bool zero_allowed) {
  // CLI11's own names the greatest double as the other limit. Words are refused by the option.
  return {[zero_allowed](const std::string& text) {
            const double number = std::strtod(text.c_str(), nullptr);
            const bool enough = number > 0 || (zero_allowed && number == 0);
            const bool octal = BeginsWithZero(text);
            if (enough && std::isfinite(number) && !octal) return std::string();
            return fmt::format("found {}, expected a number {}{}", text,
                               zero_allowed ? "from 0" : "above 0", octal ? kNoZeros : "");
          },
          "", ""};
}

}  // namespace

CLI::Validator AboveZero() { return Number(false); }
CLI::Validator NotNegative() { return Number(true); }

CLI::Validator Between(double low, double high) {
  return {[low, high](const std::string& text) {
            const auto number = FiniteNumber(text);
            if (number && *number >= low && *number <= high) return std::string();
            return fmt::format("found '{}', expected a number from {} to {}", text, low, high);
          },
          fmt::format("{} to {}", low, high), ""};
}

CLI::Validator WholeBetween(std::int64_t low, std::int64_t high) {
  return {[low, high](const std::string& text) {
            std::int64_t number = 0;
            const char* last = text.data() + text.size();
            const auto [end, fault] = std::from_chars(text.data(), last, number);
            if (fault == std::errc() && end == last && !BeginsWithZero(text) && number >= low &&
                number <= high) {
              return std::string();
            }
            return fmt::format("found '{}', expected a whole number from {} to {}{}", text, low,
                               high, BeginsWithZero(text) ? kNoZeros : "");
          },
          fmt::format("{} to {}", low, high), ""};
}

CLI::Validator OneOf(const std::vector<std::string>& words) {
  return {[words](const std::string& text) {
            if (std::find(words.begin(), words.end(), text) != words.end()) return std::string();
            return fmt::format("found '{}', expected {}{}", text, words.size() > 1 ? "one of " : "",
                               fmt::join(words, ", "));
          },
          fmt::format("{}", fmt::join(words, "|")), ""};
}

CLI::Validator NotEmpty(const std::string& expected) {
  return {[expected](const std::string& text) {
            return text.empty() ? "found nothing, expected " + expected : std::string();
          },
          "", ""};
}

ProgressBar::ProgressBar(std::string title)
    : title_(std::move(title)), terminal_(isatty(STDERR_FILENO) != 0) {}

ProgressBar::~ProgressBar() {
  if (shown_) std::fputs("\r\033[K", stderr);
}

void ProgressBar::Show(int done, int total, int before) {
  if (!terminal_ || total <= 0) return;
  constexpr int kWidth = 40;
  const int filled = kWidth * done / total;
  const double elapsed_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const std::string line = fmt::format(
      "\r{} [{}{}] {}/{} {}\033[K", title_, std::string(static_cast<std::size_t>(filled), '#'),
      std::string(static_cast<std::size_t>(kWidth - filled), ' '), done, total,
      SpeedText(done - before, total - before, elapsed_s));
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
  shown_ = true;
}

std::string SpeedText(int done, int total, double elapsed_s) {
  if (done <= 0 || elapsed_s <= 0) return "";
  const double per_second = done / elapsed_s;
  const auto left_s = static_cast<int>((total - done) / per_second + 0.5);
  return fmt::format("{:.1f} frames/s, {}:{:02d} left", per_second, left_s / 60, left_s % 60);
}

void AddFollowLinks(CLI::App& app) {
  app.add_flag_callback(
      "--follow-links", [] { SetLinkPolicy(LinkPolicy::kAnywhere); },
      "Follow symbolic links that lead out of the data's folder (docs/limits.md)");
}

std::vector<std::string> SplitList(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, ',');) {
    if (!word.empty()) words.push_back(word);
  }
  return words;
}

Expected<std::vector<std::string>> NamesOf(const std::string& option, const std::string& text) {
  std::vector<std::string> names = SplitList(text);
  if (!text.empty() && names.empty()) return UsageError("{} '{}' names no object", option, text);
  return names;
}

std::string CommandText(const CLI::App& app) {
  std::string text = "tsdfpp " + app.get_name();
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() == 0) continue;
    if (!option->get_positional()) text += " " + option->get_name();
    if (option->get_items_expected_max() == 0) continue;  // a flag
    for (const std::string& value : option->results()) text += " " + value;
  }
  return text;
}

}  // namespace tsdfpp
