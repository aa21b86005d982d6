// Paths that come from data: they stay inside the data's own folder.
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/limits.h"

namespace tsdfpp {

// Where symbolic links within data may lead.
enum class LinkPolicy {
  kInside,    // to what is inside the folder too
  kAnywhere,  // wherever they lead: --follow-links
};

// That of the process: kInside until a program sets another as it begins.
LinkPolicy CurrentLinkPolicy();
void SetLinkPolicy(LinkPolicy policy);

// A path as data may say it: relative, not empty, without "..", control characters or more than
// 4096 bytes. `what` begins the sentence. Errors: kData.
Expected<void> CheckRelativePath(std::string_view path, std::string_view what);

// A folder of data, e.g. of a sequence. May be used from several threads at once.
class DataFolder {
 public:
  explicit DataFolder(std::filesystem::path root);

  const std::filesystem::path& root() const { return root_; }

  // Where the file with this path, as the data says it, is; it need not exist. Errors: kData where
  // the path leaves the folder, by itself or through links that the policy does not follow.
  Expected<std::filesystem::path> Find(std::string_view relative) const;

  // Its bytes. Errors: those of Find and ReadFile.
  Expected<std::string> Read(std::string_view relative, Limit limit = &Limits::file_bytes) const;

  // Errors: kData where links lead from `path`, which is below the root, out of the folder.
  Expected<void> CheckLinks(const std::filesystem::path& path) const;

 private:
  bool IsInside(const std::filesystem::path& canonical) const;

  std::filesystem::path root_;
  std::filesystem::path canonical_root_;  // empty where there is no such folder
  mutable std::mutex mutex_;
  mutable std::map<std::filesystem::path, bool> is_inside_;  // folders looked at
};

// All links in the folder and below: those that lead out of it are refused unless the policy
// follows them. Errors: kData, naming the first in order of the paths.
Expected<void> CheckLinksBelow(const std::filesystem::path& folder);

}  // namespace tsdfpp
