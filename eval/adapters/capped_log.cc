#include "eval/adapters/capped_log.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "core/one_line.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kRemembered =
    16384;  // bytes of the end, in which the last line is looked for

bool IsContinuation(char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80U; }

}  // namespace

Expected<CappedLog> CappedLog::Open(const std::filesystem::path& path, std::int64_t most_bytes) {
  const int file =
      open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0644);
  if (file < 0) {
    return EnvironmentError("{}: cannot be written ({})", path.string(), std::strerror(errno));
  }
  return CappedLog(path, file, static_cast<std::size_t>(std::max<std::int64_t>(most_bytes, 2) / 2));
}

CappedLog::CappedLog(CappedLog&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      half_(other.half_),
      head_(other.head_),
      tail_(std::move(other.tail_)),
      last_(std::move(other.last_)),
      bytes_(other.bytes_),
      dropped_(other.dropped_),
      failure_(other.failure_) {}

CappedLog::~CappedLog() {
  if (file_ >= 0) close(file_);
}

void CappedLog::Write(std::string_view bytes) {
  while (!bytes.empty() && failure_ == 0) {
    const ssize_t written = write(file_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      failure_ = written < 0 ? errno : ENOSPC;
      return;
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void CappedLog::Add(std::string_view bytes) {
  bytes_ += static_cast<std::int64_t>(bytes.size());
  last_ += bytes.substr(bytes.size() - std::min(bytes.size(), kRemembered));
  if (last_.size() > 2 * kRemembered) last_.erase(0, last_.size() - kRemembered);
  const std::string_view head = bytes.substr(0, half_ - head_);
  Write(head);
  head_ += head.size();
  tail_ += bytes.substr(head.size());
  if (tail_.size() > 2 * half_) {
    dropped_ += static_cast<std::int64_t>(tail_.size() - half_);
    tail_.erase(0, tail_.size() - half_);
  }
}

Expected<void> CappedLog::Finish() {
  if (tail_.size() > half_) {
    dropped_ += static_cast<std::int64_t>(tail_.size() - half_);
    tail_.erase(0, tail_.size() - half_);
  }
  if (dropped_ > 0) {
    // Not in the middle of a character.
    constexpr std::size_t kMostOfOne = 3;
    std::size_t cut = 0;
    while (cut < std::min(kMostOfOne, tail_.size()) && IsContinuation(tail_[cut])) ++cut;
    dropped_ += static_cast<std::int64_t>(cut);
    tail_.erase(0, cut);
    Write(fmt::format("\n[... {} bytes are left out here ...]\n", dropped_));
  }
  Write(tail_);
  tail_.clear();
  const int closed = close(std::exchange(file_, -1));
  if (failure_ == 0 && closed != 0) failure_ = errno;
  if (failure_ != 0) {
    return EnvironmentError("{}: cannot be written ({})", path_.string(), std::strerror(failure_));
  }
  return {};
}

std::string CappedLog::LastLine() const {
  std::string_view text = last_;
  while (!text.empty()) {
    const std::size_t end = text.find_last_not_of("\r\n");
    if (end == std::string_view::npos) break;
    text = text.substr(0, end + 1);
    const std::size_t start = text.find_last_of("\r\n");
    std::string_view line = start == std::string_view::npos ? text : text.substr(start + 1);
    const auto says = [](char c) {
      return static_cast<unsigned char>(c) > 0x20 && static_cast<unsigned char>(c) != 0x7F;
    };
    if (std::any_of(line.begin(), line.end(), says)) {
      if (line.size() <= kLastLine_bytes) return OneLine(line);
      line.remove_prefix(line.size() - kLastLine_bytes);
      for (int i = 0; i < 3 && IsContinuation(line.front()); ++i) line.remove_prefix(1);
      return "..." + OneLine(line);
    }
    if (start == std::string_view::npos) break;
    text = text.substr(0, start);
  }
  return "";
}

}  // namespace tsdfpp
