// A new sequence grows in a hidden folder beside its place and appears there whole.
#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"

namespace tsdfpp {

// May a sequence be written to `out`? It must be absent, an empty folder or, with `overwrite`, an
// earlier sequence of ours; a link is followed. The working folder is refused, and so is what it
// lies in. Errors: kUsage, saying what is there.
Expected<void> CheckReplaceable(const std::filesystem::path& out, bool overwrite);

// The hidden folder. Removed again in the end, unless it took out's place or was kept.
class StagingFolder {
 public:
  // kOwn: this process's alone, begun anew. kShared: found again by a later process, which goes on
  // where this one stopped; one process at a time may have it.
  enum class Kind { kOwn, kShared };

  explicit StagingFolder(const std::filesystem::path& out, Kind kind = Kind::kOwn);
  ~StagingFolder();
  StagingFolder(const StagingFolder&) = delete;
  StagingFolder& operator=(const StagingFolder&) = delete;

  // Where the set's files go.
  const std::filesystem::path& path() const { return path_; }
  // Of a shared one: a folder for notes, which are not part of the set.
  std::filesystem::path notes() const;

  // Makes the folder; a shared one may be there already, with what was in it but for half-written
  // files. Removes what killed processes left that were making the same set for themselves. What
  // stands at `out` may have come while it waited: CheckReplaceable again.
  // Errors: kEnvironment where the disk refuses or another process has it.
  Expected<void> Make();
  // Makes it empty, notes and all.
  Expected<void> Clear();
  // Leaves it for a later process, whatever happens.
  void Keep() { keep_ = true; }

  // Puts it in out's place, and removes the earlier folder. Both change places in one stroke where
  // the file system can do that; else the earlier one is moved aside first, so that a failure
  // leaves it as it was. Errors: kEnvironment.
  Expected<void> TakeThePlace();

 private:
  std::filesystem::path Sibling(const std::string& suffix) const;
  // The folders of this name that processes left which were killed.
  void RemoveAbandoned();
  Expected<void> Lock();
  // False where the file system cannot exchange two folders: then all is as before.
  bool Exchange();

  std::filesystem::path out_;
  Kind kind_;
  std::filesystem::path root_;  // what is hidden; of a shared one it holds notes and set
  std::filesystem::path path_;
  int lock_ = -1;      // descriptor of a file beside root_ (kShared), or of root_ itself
  bool mine_ = false;  // made here, so ours to remove
  bool keep_ = false;
};

}  // namespace tsdfpp
