#include "core/folders.h"

#include <algorithm>

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

Error CannotList(const fs::path& folder, const std::error_code& code) {
  return {ErrorKind::kData,
          fmt::format("{}: cannot be read as a folder ({})", folder.string(), code.message())};
}

}  // namespace

Expected<std::vector<fs::path>> ListFolder(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code code;
  for (fs::directory_iterator at(folder, code), end; !code && at != end; at.increment(code)) {
    entries.push_back(at->path());
  }
  if (code) return tl::unexpected(CannotList(folder, code));
  std::sort(entries.begin(), entries.end());
  return entries;
}

std::vector<fs::path> EntriesOf(const fs::path& folder) {
  auto entries = ListFolder(folder);
  return entries ? std::move(*entries) : std::vector<fs::path>();
}

Expected<std::vector<fs::path>> ListFilesBelow(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code code;
  for (fs::recursive_directory_iterator at(folder, code), end; !code && at != end;
       at.increment(code)) {
    // Its path may be longer than the system takes.
    std::error_code unseen;
    const fs::file_type type = at->symlink_status(unseen).type();
    if (unseen && type != fs::file_type::not_found) {
      code = unseen;
      break;
    }
    if (type != fs::file_type::directory) files.push_back(at->path());
  }
  if (code) return tl::unexpected(CannotList(folder, code));
  std::sort(files.begin(), files.end());
  return files;
}

bool IsThere(const fs::path& path) {
  std::error_code code;
  return fs::exists(path, code);
}

bool IsFolder(const fs::path& path) {
  std::error_code code;
  return fs::is_directory(path, code);
}

fs::path AbsolutePath(const fs::path& path) {
  std::error_code code;
  const fs::path absolute = fs::absolute(path, code);
  return code ? path : absolute;
}

fs::path TruePath(const fs::path& path) {
  // Of a relative path whose first part is not there the library makes no absolute one.
  const fs::path absolute = AbsolutePath(path);
  std::error_code code;
  const fs::path followed = fs::weakly_canonical(absolute, code);
  return code ? absolute.lexically_normal() : followed;
}

bool LiesIn(const fs::path& path, const fs::path& place) {
  if (place.empty()) return false;
  const fs::path way = TruePath(path).lexically_relative(TruePath(place));
  return !way.empty() && *way.begin() != "..";
}

Expected<void> CheckWay(const fs::path& folder, const fs::path& place,
                        const std::set<std::string>& going) {
  std::error_code failure;
  fs::path way;
  for (const fs::path& part : place.parent_path()) {
    way /= part;
    if (going.contains(way.string())) continue;
    if (fs::is_symlink(fs::symlink_status(folder / way, failure))) {
      return UsageError("{}: is a link, expected a folder or nothing", (folder / way).string());
    }
    const fs::file_status status = fs::status(folder / way, failure);
    if (fs::exists(status) && !fs::is_directory(status)) {
      return UsageError("{}: is a file, expected a folder or nothing", (folder / way).string());
    }
  }
  return {};
}

std::string OwnName(const fs::path& folder) {
  return AbsolutePath(folder / "").lexically_normal().parent_path().filename().string();
}

}  // namespace tsdfpp
