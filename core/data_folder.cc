#include "core/data_folder.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/files.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

LinkPolicy& PolicyInForce() {
  static LinkPolicy policy = LinkPolicy::kInside;
  return policy;
}

Error LeadsOut(const fs::path& path, const fs::path& to) {
  return {ErrorKind::kData,
          fmt::format("{}: leads by a link to {}, outside of the data's folder (--follow-links, or "
                      "a copy in its place, reads it)",
                      path.string(), Quoted(to.string()))};
}

}  // namespace

LinkPolicy CurrentLinkPolicy() { return PolicyInForce(); }

void SetLinkPolicy(LinkPolicy policy) { PolicyInForce() = policy; }

Expected<void> CheckRelativePath(std::string_view path, std::string_view what) {
  constexpr std::size_t kMostPathBytes = 4096;
  const auto refuse = [&](const char* fault) {
    return DataError("{}: the path {} {}, expected one inside the data's folder", what,
                     Quoted(path), fault);
  };
  if (path.empty()) return refuse("is empty");
  if (path.size() > kMostPathBytes) return refuse("is longer than 4096 bytes");
  if (HasControl(path)) return refuse("holds a control character");
  if (path.front() == '/') return refuse("is absolute");
  for (const fs::path& part : fs::path(path)) {
    if (part == "..") return refuse("holds '..'");
  }
  return {};
}

DataFolder::DataFolder(fs::path root) : root_(std::move(root)) {
  std::error_code code;
  canonical_root_ = fs::canonical(root_.empty() ? fs::path(".") : root_, code);
  if (code) canonical_root_.clear();
}

bool DataFolder::IsInside(const fs::path& canonical) const {
  const auto [root_end, at] = std::mismatch(canonical_root_.begin(), canonical_root_.end(),
                                            canonical.begin(), canonical.end());
  return root_end == canonical_root_.end();
}

Expected<fs::path> DataFolder::Find(std::string_view relative) const {
  TSDFPP_RETURN_IF_ERROR(CheckRelativePath(relative, root_.string()));
  fs::path path = root_ / relative;
  TSDFPP_RETURN_IF_ERROR(CheckLinks(path));
  return path;
}

Expected<std::string> DataFolder::Read(std::string_view relative, Limit limit) const {
  TSDFPP_ASSIGN(const fs::path path, Find(relative));
  return ReadFile(path, limit);
}

Expected<void> DataFolder::CheckLinks(const fs::path& path) const {
  if (CurrentLinkPolicy() == LinkPolicy::kAnywhere || canonical_root_.empty()) return {};
  std::error_code code;
  const fs::path folder = path.parent_path();
  const auto folder_is_inside = [&] {
    const std::lock_guard lock(mutex_);
    const auto known = is_inside_.find(folder);
    if (known != is_inside_.end()) return known->second;
    const fs::path canonical = fs::canonical(folder.empty() ? fs::path(".") : folder, code);
    // What cannot be resolved cannot be opened either, and whoever tries says why.
    return is_inside_.emplace(folder, code || IsInside(canonical)).first->second;
  };
  const bool whole_way = !folder_is_inside() || fs::is_symlink(fs::symlink_status(path, code));
  if (!whole_way) return {};
  const fs::path canonical = fs::canonical(path, code);
  if (code || IsInside(canonical)) return {};
  return tl::unexpected(LeadsOut(path, canonical));
}

Expected<void> CheckLinksBelow(const fs::path& folder) {
  if (CurrentLinkPolicy() == LinkPolicy::kAnywhere) return {};
  std::vector<fs::path> links;
  std::error_code code;
  fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, code);
  if (code) return {};  // whoever reads it says why it cannot be
  for (const fs::recursive_directory_iterator end; !code && at != end; at.increment(code)) {
    std::error_code ignored;
    if (at->is_symlink(ignored)) links.push_back(at->path());
  }
  if (code)
    return DataError("{}: cannot be read as a folder ({})", folder.string(), code.message());
  std::sort(links.begin(), links.end());
  const DataFolder data(folder);
  for (const fs::path& link : links) TSDFPP_RETURN_IF_ERROR(data.CheckLinks(link));
  return {};
}

}  // namespace tsdfpp
