#include "sequence/staging_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <vector>

#include "core/files.h"
#include "sequence/cofusion_layout.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr const char* kLock = "lock";
constexpr const char* kNotes = "notes";
constexpr const char* kSet = "set";

// An absolute path without a trailing slash has a file name and a folder it stands in.
fs::path Normal(const fs::path& out) {
  const fs::path folder = fs::absolute(out).lexically_normal();
  return folder.has_filename() ? folder : folder.parent_path();
}

}  // namespace

Expected<void> CheckReplaceable(const fs::path& out, bool overwrite) {
  const fs::path folder = Normal(out);
  std::error_code code;
  if (!fs::exists(folder, code)) return {};
  if (!fs::is_directory(folder, code)) {
    return UsageError("{}: is a file, expected a folder to make", folder.string());
  }
  if (fs::is_empty(folder, code)) return {};
  const bool ours = ReadSequenceJson(folder / cofusion::kSequence).has_value();
  if (!ours) {
    return UsageError(
        "{}: the folder holds something other than a sequence of ours, expected a "
        "new or an empty folder",
        folder.string());
  }
  if (!overwrite) {
    return UsageError(
        "{}: already holds a sequence, expected a new folder or leave to overwrite it",
        folder.string());
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
  if (lock_ >= 0) close(lock_);
}

fs::path StagingFolder::Sibling(const std::string& suffix) const {
  return out_.parent_path() / fmt::format(".{}.{}", out_.filename().string(), suffix);
}

Expected<void> StagingFolder::Make() {
  std::error_code code;
  if (kind_ == Kind::kOwn) fs::remove_all(root_, code);
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(root_));
  if (kind_ == Kind::kShared) TSDFPP_RETURN_IF_ERROR(Lock());
  mine_ = true;
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(path_));
  // What a killed process was just writing (core/files.h).
  std::vector<fs::path> halves;
  for (const auto& entry : fs::recursive_directory_iterator(root_, code)) {
    if (entry.path().extension() == ".part") halves.push_back(entry.path());
  }
  for (const fs::path& half : halves) fs::remove(half, code);
  return {};
}

Expected<void> StagingFolder::Lock() {
  lock_ = open((root_ / kLock).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  // The children of a process that was killed follow it in a moment.
  constexpr int kTries = 40;
  constexpr useconds_t kPause_us = 50000;
  for (int i = 0; lock_ >= 0 && i < kTries; ++i) {
    if (flock(lock_, LOCK_EX | LOCK_NB) == 0) return {};
    usleep(kPause_us);
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

Expected<void> StagingFolder::TakeThePlace() {
  const fs::path old = Sibling(fmt::format("{}.old", getpid()));
  std::error_code code;
  const bool replaces = fs::exists(out_, code);
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
