#include "cli/command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <sstream>

namespace tsdfpp {
namespace {

CLI::Validator Number(bool zero_allowed) {
  // CLI11's own names the greatest double as the other limit. Words are refused by the option.
  return {[zero_allowed](const std::string& text) {
            const double number = std::strtod(text.c_str(), nullptr);
            if (number > 0 || (zero_allowed && number == 0)) return std::string();
            return fmt::format("found {}, expected a number {}", text,
                               zero_allowed ? "from 0" : "above 0");
          },
          "", ""};
}

}  // namespace

CLI::Validator AboveZero() { return Number(false); }
CLI::Validator NotNegative() { return Number(true); }

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

std::vector<std::string> SplitList(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, ',');) {
    if (!word.empty()) words.push_back(word);
  }
  return words;
}

}  // namespace tsdfpp
