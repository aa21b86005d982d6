#include "eval/run/run_folder.h"

#include <sys/random.h>

#include <utility>
#include <vector>

#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kRunStaging = ".tsdfpp-run";
// Every file that the old run left or the new one is about to leave, while neither has a run.json.
constexpr const char* kRunMoving = ".tsdfpp-moving";

std::string NewRunId() {
  std::uint64_t number = 0;
  // Never fails for so few bytes once the machine has started.
  if (getrandom(&number, sizeof number, 0) != sizeof number) number = 0;
  return fmt::format("{:016x}", number);
}

// A path that stays in its folder: no root, no "..", no blank component.
bool StaysInside(const fs::path& place) {
  if (place.empty() || place.has_root_path()) return false;
  for (const fs::path& part : place) {
    if (part.empty() || part == ".." || part == ".") return false;
  }
  return true;
}

json RunNoteJson(const RunNote& note) {
  json files = json::array();
  for (const auto& [name, bytes] : note.files) {
    files.push_back({{"name", name}, {"bytes", bytes ? json(*bytes) : json(nullptr)}});
  }
  return {{"schema", 1},
          {"generator", "tsdfpp"},
          {"command", OneLine(note.command, 4 * note.command.size())},
          {"run", note.run},
          {"files", std::move(files)}};
}

Expected<std::optional<RunNote>> ReadNote(const fs::path& path) {
  std::error_code failure;
  if (!fs::exists(fs::symlink_status(path, failure))) return std::nullopt;
  TSDFPP_ASSIGN(const json value, ReadJsonObject(path));
  const auto wrong = [&](const char* what) {
    return DataError("{}: {}, expected what tsdfpp writes", path.string(), what);
  };
  if (value.value("schema", json()) != 1) return wrong("'schema' is not 1");
  for (const char* name : {"run", "command"}) {
    if (!value.contains(name) || !value[name].is_string()) return wrong("has no run or no command");
  }
  if (!value.contains("files") || !value["files"].is_array()) return wrong("lists no files");
  RunNote note;
  note.run = value["run"].get<std::string>();
  note.command = value["command"].get<std::string>();
  for (const json& file : value["files"]) {
    if (!file.is_object() || !file.contains("name") || !file["name"].is_string() ||
        !file.contains("bytes") ||
        !(file["bytes"].is_null() || file["bytes"].is_number_unsigned())) {
      return wrong("a file has no name or no size");
    }
    const std::string name = file["name"].get<std::string>();
    if (!StaysInside(name)) return wrong("a file lies elsewhere");
    note.files[name] =
        file["bytes"].is_null() ? std::nullopt : std::optional(file["bytes"].get<std::uintmax_t>());
  }
  return note;
}

// Whether every folder on the way to the place is one, and no link to one.
bool IsReachable(const fs::path& folder, const fs::path& place) {
  fs::path at = folder;
  std::error_code failure;
  for (const fs::path& part : place.parent_path()) {
    at /= part;
    if (!fs::is_directory(fs::symlink_status(at, failure))) return false;
  }
  return true;
}

// Removes a file, and the folders that are empty without it, also where the file is gone already: a
// run may have been killed between the two.
Expected<void> RemoveOld(const fs::path& folder, const fs::path& place) {
  std::error_code failure;
  if (IsReachable(folder, place) &&
      !fs::is_directory(fs::symlink_status(folder / place, failure))) {
    fs::remove(folder / place, failure);
    if (failure) {
      return EnvironmentError("{}: cannot be removed ({})", (folder / place).string(),
                              failure.message());
    }
  }
  for (fs::path parent = place.parent_path(); !parent.empty(); parent = parent.parent_path()) {
    if (!IsReachable(folder, parent / "any")) continue;
    fs::remove(folder / parent, failure);
    if (failure) break;  // something else is in it
  }
  return {};
}

// All below the folder that is no folder itself.
std::vector<fs::path> FilesIn(const fs::path& folder, std::error_code& failure) {
  std::vector<fs::path> files;
  for (fs::recursive_directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    std::error_code unknown;
    if (!fs::is_directory(entry->symlink_status(unknown))) files.push_back(entry->path());
  }
  return files;
}

// Removes a folder of folders alone, which stands where a file goes: a rename would fail.
void RemoveFolders(const fs::path& folder) {
  std::error_code failure;
  if (!fs::is_directory(fs::symlink_status(folder, failure))) return;
  std::vector<fs::path> folders{folder};
  for (fs::recursive_directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    folders.push_back(entry->path());
  }
  // The inner ones first. What is no folder, or has something in it, stays.
  for (auto inner = folders.rbegin(); inner != folders.rend(); ++inner) {
    if (fs::is_directory(fs::symlink_status(*inner, failure))) fs::remove(*inner, failure);
  }
}

Expected<void> MoveTo(const fs::path& from, const fs::path& to) {
  std::error_code failure;
  fs::rename(from, to, failure);
  if (failure) {
    return EnvironmentError("{}: cannot be put in place ({})", to.string(), failure.message());
  }
  return {};
}

}  // namespace

RunFolder::RunFolder(FolderLock lock, fs::path out, const std::string& command)
    : lock_(std::move(lock)), out_(std::move(out)), staging_(out_ / kRunStaging) {
  note_.run = NewRunId();
  note_.command = command;
}

Expected<RunFolder> RunFolder::Begin(const fs::path& out, const std::string& command) {
  std::error_code failure;
  fs::create_directories(out, failure);
  if (failure) {
    return EnvironmentError("{}: the folder cannot be made ({})", out.string(), failure.message());
  }
  TSDFPP_ASSIGN(FolderLock lock, FolderLock::Take(out));
  RunFolder run(std::move(lock), out, command);
  fs::remove_all(run.staging_, failure);
  if (failure) {
    return EnvironmentError("{}: cannot be removed ({})", run.staging_.string(), failure.message());
  }
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(run.staging_));
  return run;
}

RunFolder::RunFolder(RunFolder&& other) noexcept
    : lock_(std::move(other.lock_)),
      out_(std::move(other.out_)),
      staging_(std::exchange(other.staging_, {})),
      note_(std::move(other.note_)) {}

RunFolder::~RunFolder() {
  std::error_code ignored;
  if (!staging_.empty()) fs::remove_all(staging_, ignored);
}

Expected<void> RunFolder::ListFiles(const std::set<std::string>& rewritten) {
  std::error_code failure;
  for (const fs::path& file : FilesIn(staging_, failure)) {
    const std::string name = file.lexically_relative(staging_).string();
    if (!IsShowable(name)) {
      return DataError("{}: has a name that cannot be printed, expected UTF-8",
                       OneLine((out_ / name).string()));
    }
    const std::uintmax_t bytes = fs::file_size(file, failure);
    if (failure) break;
    note_.files[name] = rewritten.contains(name) ? std::nullopt : std::optional(bytes);
  }
  if (failure) {
    return EnvironmentError("{}: cannot be listed ({})", staging_.string(), failure.message());
  }
  return {};
}

std::set<std::string> RunFolder::OldFiles() const {
  std::set<std::string> old;
  for (const char* place : {kRunNote, kRunMoving}) {
    // One that is none of ours says nothing, and goes.
    const auto note = ReadNote(out_ / place);
    if (!note || !*note) continue;
    for (const auto& [name, bytes] : (*note)->files) old.insert(name);
  }
  return old;
}

Expected<void> RunFolder::CheckPlaces(const std::set<std::string>& files) const {
  TSDFPP_RETURN_IF_ERROR(CheckWays(files));
  const std::set<std::string> old = OldFiles();
  std::error_code failure;
  for (const std::string& name : files) {
    const fs::file_status there = fs::symlink_status(out_ / name, failure);
    if (!fs::exists(there) || fs::is_directory(there) || old.contains(name)) continue;
    return UsageError("{}: is of no earlier run and would be replaced, expected another folder",
                      (out_ / name).string());
  }
  return {};
}

Expected<void> RunFolder::CheckPlaces() const {
  std::error_code failure;
  std::set<std::string> files;
  for (const fs::path& file : FilesIn(staging_, failure)) {
    files.insert(file.lexically_relative(staging_).string());
  }
  if (failure) {
    return EnvironmentError("{}: cannot be listed ({})", staging_.string(), failure.message());
  }
  return CheckPlaces(files);
}

// What stands where a file or its folders are to be, but for files.
Expected<void> RunFolder::CheckWays(std::set<std::string> files) const {
  const std::set<std::string> old = OldFiles();
  files.insert({kRunNote, kRunMoving});
  std::error_code failure;
  for (const std::string& name : files) {
    TSDFPP_RETURN_IF_ERROR(CheckWay(out_, name, old));
    const fs::file_status there = fs::symlink_status(out_ / name, failure);
    if (fs::is_other(there)) {
      return UsageError("{}: is no regular file, expected one or nothing", (out_ / name).string());
    }
    if (!fs::is_directory(there)) continue;
    // A folder of the old run's files alone goes with them, and one without files.
    for (const fs::path& file : FilesIn(out_ / name, failure)) {
      if (!old.contains(file.lexically_relative(out_).string())) {
        return UsageError("{}: is a folder with files in it, expected a file or nothing",
                          (out_ / name).string());
      }
    }
  }
  return {};
}

Expected<void> RunFolder::MoveFiles(const std::set<std::string>& old) const {
  for (const std::string& name : old) {
    if (!note_.files.contains(name)) TSDFPP_RETURN_IF_ERROR(RemoveOld(out_, name));
  }
  for (const auto& [name, bytes] : note_.files) {
    const fs::path to = out_ / name;
    std::error_code failure;
    fs::create_directories(to.parent_path(), failure);
    if (failure) {
      return EnvironmentError("{}: the folder cannot be made ({})", to.parent_path().string(),
                              failure.message());
    }
    RemoveFolders(to);
    TSDFPP_RETURN_IF_ERROR(MoveTo(staging_ / name, to));
  }
  return {};
}

Expected<void> RunFolder::Commit(const std::set<std::string>& rewritten) {
  TSDFPP_RETURN_IF_ERROR(ListFiles(rewritten));
  std::set<std::string> names;
  for (const auto& [name, bytes] : note_.files) names.insert(name);
  TSDFPP_RETURN_IF_ERROR(CheckWays(std::move(names)));
  const std::set<std::string> old = OldFiles();
  RunNote moving = note_;
  for (const std::string& name : old) moving.files.try_emplace(name, std::nullopt);
  TSDFPP_RETURN_IF_ERROR(WriteFile(staging_ / kRunMoving, JsonText(RunNoteJson(moving), 1) + "\n"));
  TSDFPP_RETURN_IF_ERROR(WriteFile(staging_ / kRunNote, JsonText(RunNoteJson(note_), 1) + "\n"));

  TSDFPP_RETURN_IF_ERROR(MoveTo(staging_ / kRunMoving, out_ / kRunMoving));
  std::error_code failure;
  fs::remove(out_ / kRunNote, failure);
  if (failure) {
    return EnvironmentError("{}: cannot be removed ({})", (out_ / kRunNote).string(),
                            failure.message());
  }
  TSDFPP_RETURN_IF_ERROR(MoveFiles(old));
  TSDFPP_RETURN_IF_ERROR(MoveTo(staging_ / kRunNote, out_ / kRunNote));
  // From here on the new result stands; what is left over goes with the next run.
  fs::remove(out_ / kRunMoving, failure);
  return {};
}

Expected<std::optional<RunNote>> ReadRunNote(const fs::path& folder) {
  return ReadNote(folder / kRunNote);
}

std::optional<std::string> RunOfSummary(const json& summary) {
  const json run = summary.is_object() ? summary.value("run", json()) : json();
  return run.is_string() ? std::optional(run.get<std::string>()) : std::nullopt;
}

Expected<void> CheckOneRun(const fs::path& folder, const std::optional<std::string>& run,
                           const std::set<std::string>& files) {
  TSDFPP_ASSIGN(const std::optional<RunNote> note, ReadRunNote(folder));
  std::error_code unknown;
  const bool moving = !note && fs::exists(folder / kRunMoving, unknown);
  if (!note && !run && !moving) return {};
  const auto interrupted = [&](const std::string& what) {
    return DataError("'{}' holds an interrupted run ({}): run the command again", folder.string(),
                     what);
  };
  if (!note) return interrupted("its run.json is missing");
  if (!run || note->run != *run) return interrupted("its summary is of another run");
  for (const std::string& name : files) {
    std::error_code failure;
    const bool there = fs::exists(folder / name, failure);
    const auto noted = note->files.find(name);
    if (noted == note->files.end()) {
      if (there) return interrupted(fmt::format("{} is not of this run", name));
      continue;
    }
    if (!there) return interrupted(fmt::format("{} is missing", name));
    const std::uintmax_t bytes = fs::file_size(folder / name, failure);
    if (noted->second && (failure || bytes != *noted->second)) {
      return interrupted(
          fmt::format("{} has {} bytes, expected {}", name, failure ? 0 : bytes, *noted->second));
    }
  }
  return {};
}

}  // namespace tsdfpp
