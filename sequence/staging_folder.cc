#include "sequence/staging_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <optional>
#include <vector>

#include "core/files.h"
#include "core/folders.h"
#include "sequence/cofusion_layout.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr const char* kNotes = "notes";
constexpr const char* kNotesAside = "notes-aside";
constexpr const char* kSet = "set";

// An absolute path without a trailing slash has a file name and a folder it stands in. Where `out`
// is a link it is the folder that the link leads to: that one is replaced, and the link stays.
fs::path Normal(const fs::path& out) {
  const fs::path folder = TruePath(out);
  return folder.has_filename() ? folder : folder.parent_path();
}

// The process in "<prefix><its number><suffix>".
std::optional<pid_t> ProcessOf(const std::string& name, const std::string& prefix,
                               const std::string& suffix) {
  const auto number = cofusion::NumberOf(name, prefix, suffix);
  return number && *number > 0 ? std::optional<pid_t>(*number) : std::nullopt;
}

// Whether nobody uses the folder any more. Another machine or container may not know the process,
// so its lock counts too.
bool IsAbandoned(const fs::path& folder, pid_t process) {
  if (process == getpid() || kill(process, 0) == 0 || errno != ESRCH) return false;
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool free = flock(descriptor, LOCK_EX | LOCK_NB) == 0;
  close(descriptor);
  return free;
}

// Whether the path leads to the file that the descriptor holds.
bool IsFileOf(const fs::path& path, int descriptor) {
  struct stat held {};
  struct stat named {};
  return fstat(descriptor, &held) == 0 && stat(path.c_str(), &named) == 0 &&
         held.st_dev == named.st_dev && held.st_ino == named.st_ino;
}

}  // namespace

Expected<void> CheckReplaceable(const fs::path& out, bool overwrite) {
  const fs::path folder = Normal(out);
  std::error_code code;
  if (fs::is_symlink(folder, code)) {
    return UsageError("{}: is a link that leads nowhere, expected a folder to make",
                      folder.string());
  }
  if (!fs::exists(folder, code)) return {};
  // Who works in it would be left in a folder that is gone.
  if (LiesIn(".", folder)) {
    return UsageError("{}: is or holds the working folder, expected one that can be replaced",
                      folder.string());
  }
  if (!fs::is_directory(folder, code)) {
    return UsageError("{}: is a file, expected a folder to make", folder.string());
  }
  if (fs::is_empty(folder, code)) return {};
  const auto ours = ReadSequenceJson(folder / cofusion::kSequence);
  if (!ours) {
    return UsageError(
        "{}: the folder holds something other than a sequence of ours, expected a "
        "new or an empty folder",
        folder.string());
  }
  if (!overwrite) {
    return UsageError("{}: the folder already holds a sequence, expected a new or an empty folder",
                      folder.string());
  }
  TSDFPP_ASSIGN(const std::vector<fs::path> there, ListFilesBelow(folder));
  for (const fs::path& path : there) {
    const std::string file = path.lexically_relative(folder).string();
    if (file == cofusion::kSequence || ours->hashes.contains(file)) continue;
    return UsageError("{}: is no file of the sequence and would be gone, expected it elsewhere",
                      path.string());
  }
  return {};
}

StagingFolder::StagingFolder(const fs::path& out, Kind kind) : out_(Normal(out)), kind_(kind) {
  root_ = Sibling(kind == Kind::kOwn ? fmt::format("{}.part", getpid()) : "part");
  path_ = kind == Kind::kOwn ? root_ : root_ / kSet;
}

fs::path StagingFolder::notes() const { return root_ / kNotes; }

StagingFolder::~StagingFolder() {
  std::error_code ignored;
  if (mine_ && !keep_) fs::remove_all(root_, ignored);
  // Last, and while it is held: who waits for it sees that it is gone.
  if (lock_ >= 0 && kind_ == Kind::kShared) fs::remove(Sibling("lock"), ignored);
  if (lock_ >= 0) close(lock_);
}

fs::path StagingFolder::Sibling(const std::string& suffix) const {
  return out_.parent_path() / fmt::format(".{}.{}", out_.filename().string(), suffix);
}

Expected<void> StagingFolder::Make() {
  RemoveAbandoned();
  std::error_code code;
  if (kind_ == Kind::kOwn) {
    fs::remove_all(root_, code);
    TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(root_));
    // The lock is the folder's, by whatever name; without one its process is asked for.
    lock_ = open(root_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (lock_ >= 0) flock(lock_, LOCK_EX | LOCK_NB);
  } else {
    TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(out_.parent_path()));
    TSDFPP_RETURN_IF_ERROR(Lock());
    TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(root_));
  }
  mine_ = true;
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(path_));
  // What a killed process was just writing (core/files.h).
  TSDFPP_ASSIGN(const std::vector<fs::path> files, ListFilesBelow(root_));
  for (const fs::path& file : files) {
    if (file.extension() == ".part") fs::remove(file, code);
  }
  return {};
}

void StagingFolder::RemoveAbandoned() {
  const std::string prefix = Sibling("").filename().string();
  std::error_code code;
  std::vector<fs::path> abandoned;
  for (const fs::path& entry : EntriesOf(out_.parent_path())) {
    const std::string name = entry.filename().string();
    const auto making = ProcessOf(name, prefix, ".part");
    // An earlier sequence that was moved aside goes only where another is in its place.
    const auto replacing = fs::exists(out_, code) ? ProcessOf(name, prefix, ".old") : std::nullopt;
    const auto process = making ? making : replacing;
    if (process && IsAbandoned(entry, *process)) abandoned.push_back(entry);
  }
  for (const fs::path& folder : abandoned) fs::remove_all(folder, code);
}

Expected<void> StagingFolder::Lock() {
  // A file beside the hidden folder, so that it stays where it is when folders are renamed.
  const fs::path path = Sibling("lock");
  // The children of a process that was killed follow it in a moment.
  constexpr int kTries = 200;
  constexpr useconds_t kPause_us = 50000;
  for (int i = 0; i < kTries; ++i) {
    const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    const bool locked = descriptor >= 0 && flock(descriptor, LOCK_EX | LOCK_NB) == 0;
    const int fault = errno;
    // Who held it before may have removed it after it was opened here.
    if (locked && IsFileOf(path, descriptor)) {
      lock_ = descriptor;
      return {};
    }
    if (descriptor >= 0) close(descriptor);
    if (!locked && fault != EWOULDBLOCK) {
      return EnvironmentError("{}: cannot be locked ({})", path.string(), std::strerror(fault));
    }
    if (!locked) usleep(kPause_us);
  }
  return EnvironmentError("{}: another process is making this sequence", out_.string());
}

Expected<void> StagingFolder::Clear() {
  std::error_code code;
  for (const fs::path& folder : {path_, notes()}) {
    fs::remove_all(folder, code);
    if (code) {
      return EnvironmentError("{}: cannot be removed ({})", folder.string(), code.message());
    }
  }
  return MakeWritableFolder(path_);
}

bool StagingFolder::Exchange() {
  // Were this process killed in between, its notes would say of the earlier set, which stands in
  // path_ then, what is true of the new one.
  const fs::path aside = root_ / kNotesAside;
  std::error_code ignored;
  if (kind_ == Kind::kShared) fs::rename(notes(), aside, ignored);
  if (renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, out_.c_str(), RENAME_EXCHANGE) == 0) {
    fs::remove_all(root_, ignored);
    return true;
  }
  if (kind_ == Kind::kShared) fs::rename(aside, notes(), ignored);
  return false;
}

Expected<void> StagingFolder::TakeThePlace() {
  std::error_code code;
  const bool replaces = fs::exists(out_, code);
  // In one stroke, so that there is a sequence at every moment.
  if (replaces && Exchange()) {
    mine_ = false;
    return {};
  }
  // Where the file system cannot, the earlier one stands aside for a moment.
  const fs::path old = Sibling(fmt::format("{}.old", getpid()));
  if (replaces) fs::rename(out_, old, code);
  if (!code) {
    fs::rename(path_, out_, code);
    std::error_code ignored;
    if (code && replaces) fs::rename(old, out_, ignored);
    if (!code) fs::remove_all(old, ignored);
    if (!code && kind_ == Kind::kShared) fs::remove_all(root_, ignored);
  }
  if (code) {
    return EnvironmentError("{}: the folder cannot be put in place ({})", out_.string(),
                            code.message());
  }
  mine_ = false;
  return {};
}

}  // namespace tsdfpp
