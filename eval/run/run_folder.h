// What a command leaves in its output folder is of one run, whenever it is killed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

#include "core/error.h"
#include "eval/run/folder_lock.h"

namespace tsdfpp {

// run.json: what a run has left.
struct RunNote {
  std::string run;      // 16 hexadecimal digits, another for each run
  std::string command;  // as it was typed
  // Bytes of each file, by its path in the folder. Nothing: another command may write it anew.
  std::map<std::string, std::optional<std::uintmax_t>> files;
};

inline constexpr const char* kRunNote = "run.json";

// A run writes all its files into a hidden folder inside its output folder. In the end they move to
// their places: the old run.json goes first, then what else that run left; what no run wrote down
// stays, but for files of the same names as new ones that nobody asked about (CheckPlaces). The new
// run.json comes last. So whoever finds it finds all files of that run and none of another; a
// killed run leaves either the earlier result as it was or a folder without run.json, which the
// next run puts in order.
class RunFolder {
 public:
  // Makes the folder and locks it, and removes what killed runs left half done. Errors:
  // kEnvironment where another process has the folder or the disk refuses.
  static Expected<RunFolder> Begin(const std::filesystem::path& out, const std::string& command);
  // Removes what was written, unless it was committed.
  ~RunFolder();
  RunFolder(RunFolder&& other) noexcept;
  RunFolder& operator=(RunFolder&&) = delete;

  // Where to write: hidden, empty at first.
  const std::filesystem::path& path() const { return staging_; }
  // Where it will be.
  const std::filesystem::path& out() const { return out_; }
  // What the run is called in run.json; a summary names it, so that it is known to need one.
  const std::string& id() const { return note_.run; }

  // Whether files of these names could take their places: who knows what will be written asks
  // before the work. Errors: kUsage, as Commit, and where a file that no run wrote has such a name.
  Expected<void> CheckPlaces(const std::set<std::string>& files) const;
  // The same for what has been written, for who knows it only then.
  Expected<void> CheckPlaces() const;

  // Moves everything to its place. Of the files named in `rewritten` the size is not kept. Errors:
  // kUsage where a folder of somebody else's, a pipe or a device stands in a file's place, or a
  // file or link in a folder's, kData where a name cannot be printed: then all is as before;
  // kEnvironment where the disk refuses: the folder may then be without run.json, and the same
  // command puts it in order.
  Expected<void> Commit(const std::set<std::string>& rewritten = {});

 private:
  RunFolder(FolderLock lock, std::filesystem::path out, const std::string& command);
  Expected<void> ListFiles(const std::set<std::string>& rewritten);
  Expected<void> CheckWays(std::set<std::string> files) const;
  // What earlier runs left, whole or not.
  std::set<std::string> OldFiles() const;
  Expected<void> MoveFiles(const std::set<std::string>& old) const;

  FolderLock lock_;
  std::filesystem::path out_;
  std::filesystem::path staging_;  // empty after a move
  RunNote note_;
};

// What is noted in a folder. Nothing where there is no run.json. Errors: kData where it is none of
// ours.
Expected<std::optional<RunNote>> ReadRunNote(const std::filesystem::path& folder);

// What a summary (summary.json, stats.json) calls its run; nothing where it is of an older version.
std::optional<std::string> RunOfSummary(const nlohmann::json& summary);

// Whether `files`, of those that are there, are of one run. `run` is what the folder's summary
// calls its run; a summary of an older version calls it nothing, and such a folder has no run.json.
// Errors: kData, saying what to do.
Expected<void> CheckOneRun(const std::filesystem::path& folder,
                           const std::optional<std::string>& run,
                           const std::set<std::string>& files);

}  // namespace tsdfpp
