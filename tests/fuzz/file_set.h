// An input that is a set of files, as text with the files' bytes in between:
//
//   file colour/Color0001.png 118
//   <118 bytes>
//   link colour/latest 13
//   Color0001.png
//   pipe queue 0
//   <nothing>
//
// A line "<kind> <path> <bytes>" and as many bytes, then a line end. Kinds are file, link (the
// bytes are where to), pipe and folder. Blanks, control characters and backslashes of a path are
// written \xNN. What follows the first header that cannot be read is left out.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace tsdfpp::fuzz {

enum class EntryKind { kFile, kLink, kPipe, kFolder };

struct Entry {
  EntryKind kind = EntryKind::kFile;
  std::string path;
  std::string bytes;
  bool operator==(const Entry&) const = default;
};

// Entries whose path is empty, absolute, has "..", or is longer than a file system takes are left
// out, as are those after the 64th.
std::vector<Entry> UnpackSet(std::string_view input);
std::string PackSet(const std::vector<Entry>& entries);

// A folder of the process in memory (TSDFPP_FUZZ_SCRATCH, /dev/shm, or the one for temporary
// files), always of the same name, emptied by each of these.
const std::filesystem::path& WriteSet(std::string_view input);
// With one file in it; returns the file's path.
std::filesystem::path WriteOne(std::string_view name, std::string_view bytes);

}  // namespace tsdfpp::fuzz
