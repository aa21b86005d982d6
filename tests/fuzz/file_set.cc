#include "tests/fuzz/file_set.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <optional>

#include "tests/fuzz/complaint.h"

namespace tsdfpp::fuzz {
namespace fs = std::filesystem;
namespace {

constexpr std::array<std::string_view, 4> kKinds{"file", "link", "pipe", "folder"};
constexpr std::size_t kMostEntries = 64;
constexpr std::size_t kMostPathBytes = 1000;
constexpr std::size_t kMostParts = 8;

std::optional<std::string> Unescaped(std::string_view text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\\') {
      plain += text[i];
      continue;
    }
    int value = 0;
    if (i + 3 >= text.size() || text[i + 1] != 'x') return std::nullopt;
    const char* const end = text.data() + i + 4;
    if (std::from_chars(text.data() + i + 2, end, value, 16).ptr != end) return std::nullopt;
    plain += static_cast<char>(value);
    i += 3;
  }
  return plain;
}

std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = byte > ' ' && byte != 0x7F && c != '\\';
    escaped += plain ? std::string(1, c) : fmt::format("\\x{:02x}", byte);
  }
  return escaped;
}

// Nothing is ever written outside of the folder.
bool StaysBelow(const fs::path& path) {
  if (path.empty() || path.is_absolute() || path.native().size() > kMostPathBytes) return false;
  if (path.native().find('\0') != std::string::npos) return false;
  return static_cast<std::size_t>(std::distance(path.begin(), path.end())) <= kMostParts &&
         std::none_of(path.begin(), path.end(), [](const fs::path& part) {
           return part == ".." || part == "." || part.empty();
         });
}

class Scratch {
 public:
  Scratch() {
    const char* const wanted = std::getenv("TSDFPP_FUZZ_SCRATCH");
    fs::path base = wanted != nullptr ? wanted : "/dev/shm";
    if (access(base.c_str(), W_OK) != 0) base = fs::temp_directory_path();
    folder_ = base / fmt::format("tsdfpp-fuzz-{}", getpid());
    std::error_code failure;
    fs::create_directories(folder_, failure);
    folder_ = fs::canonical(folder_, failure);
    set_ = folder_ / "set";
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  const fs::path& Emptied() {
    std::error_code failure;
    fs::remove_all(folder_, failure);
    fs::create_directories(set_, failure);
    Require(!failure, "the scratch folder cannot be made");
    return set_;
  }

 private:
  fs::path folder_;
  fs::path set_;
};

Scratch& TheScratch() {
  static Scratch scratch;
  return scratch;
}

void WriteBytes(const fs::path& path, std::string_view bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

std::vector<Entry> UnpackSet(std::string_view input) {
  std::vector<Entry> entries;
  while (entries.size() < kMostEntries) {
    const std::size_t end = input.find('\n');
    if (end == input.npos) break;
    const std::string_view header = input.substr(0, end);
    input.remove_prefix(end + 1);
    const std::size_t first = header.find(' ');
    const std::size_t last = header.rfind(' ');
    if (first == header.npos || first == last) break;
    const auto kind = std::find(kKinds.begin(), kKinds.end(), header.substr(0, first));
    const auto path = Unescaped(header.substr(first + 1, last - first - 1));
    std::size_t size = 0;
    const auto number = std::from_chars(header.data() + last + 1, header.data() + end, size);
    if (kind == kKinds.end() || !path || number.ec != std::errc()) break;
    Entry entry{static_cast<EntryKind>(kind - kKinds.begin()), *path,
                std::string(input.substr(0, size))};
    input.remove_prefix(std::min(entry.bytes.size() + 1, input.size()));
    if (StaysBelow(entry.path)) entries.push_back(std::move(entry));
  }
  return entries;
}

std::string PackSet(const std::vector<Entry>& entries) {
  std::string packed;
  for (const Entry& entry : entries) {
    packed += fmt::format("{} {} {}\n", kKinds[static_cast<std::size_t>(entry.kind)],
                          Escaped(entry.path), entry.bytes.size());
    packed += entry.bytes;
    packed += '\n';
  }
  return packed;
}

const fs::path& WriteSet(std::string_view input) {
  const fs::path& folder = TheScratch().Emptied();
  const std::vector<Entry> entries = UnpackSet(input);
  std::error_code ignored;
  // Links come last, so that nothing is written through one; what does not fit is left out.
  for (const Entry& entry : entries) {
    if (entry.kind == EntryKind::kLink) continue;
    const fs::path path = folder / entry.path;
    fs::create_directories(entry.kind == EntryKind::kFolder ? path : path.parent_path(), ignored);
    if (entry.kind == EntryKind::kPipe) mkfifo(path.c_str(), S_IRUSR | S_IWUSR);
    if (entry.kind == EntryKind::kFile && !fs::is_fifo(path, ignored)) {
      WriteBytes(path, entry.bytes);
    }
  }
  for (const Entry& entry : entries) {
    const bool text = entry.bytes.find('\0') == std::string::npos;
    if (entry.kind != EntryKind::kLink || !text) continue;
    const fs::path path = folder / entry.path;
    // A folder that is a link would lead the next one out of here.
    const fs::path parent = fs::weakly_canonical(path.parent_path(), ignored);
    if (parent != path.parent_path()) continue;
    fs::create_directories(path.parent_path(), ignored);
    fs::create_symlink(entry.bytes, path, ignored);
  }
  return folder;
}

fs::path WriteOne(std::string_view name, std::string_view bytes) {
  const fs::path path = TheScratch().Emptied() / name;
  WriteBytes(path, bytes);
  return path;
}

}  // namespace tsdfpp::fuzz
