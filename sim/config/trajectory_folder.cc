#include "sim/config/trajectory_folder.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <optional>
#include <string_view>

#include "core/files.h"
#include "core/pose_text.h"

namespace tsdfpp {
namespace {

std::string FileName(const ObjectInfo& object) {
  return fmt::format("gt-{}-{}.txt", object.name, object.id);
}

std::string Lines(const std::vector<Pose>& poses) {
  std::string text;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    text += fmt::format("{} {}\n", i + 1, PoseToText(poses[i]));
  }
  return text;
}

// Calls `take` with each line's first number, as text, and the rest of the line, a pose. What
// `take` says is wrong is reported with the line.
Expected<void> ForEachPose(const std::filesystem::path& path,
                           const std::function<std::string(std::string_view, const Pose&)>& take) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path, &Limits::text_bytes));
  std::string_view rest(text);
  for (int line = 1; !rest.empty(); ++line) {
    const std::size_t end = rest.find('\n');
    std::string_view words = rest.substr(0, end);
    rest.remove_prefix(end == rest.npos ? rest.size() : end + 1);
    const std::size_t start = words.find_first_not_of(" \t\r");
    if (start == words.npos || words[start] == '#') continue;
    words.remove_prefix(start);
    const std::size_t split = std::min(words.find_first_of(" \t"), words.size());
    const auto pose = PoseFromText(words.substr(split));
    if (!pose) return DataError("{}:{}: {}", path.string(), line, pose.error().message);
    const std::string fault = take(words.substr(0, split), *pose);
    if (!fault.empty()) return DataError("{}:{}: {}", path.string(), line, fault);
  }
  return {};
}

template <typename Number>
std::optional<Number> Parse(std::string_view word) {
  Number number{};
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (status != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return number;
}

Expected<std::vector<Pose>> ReadPoses(const std::filesystem::path& path, int frames) {
  std::vector<std::optional<Pose>> found(static_cast<std::size_t>(frames));
  TSDFPP_RETURN_IF_ERROR(ForEachPose(path, [&](std::string_view word, const Pose& pose) {
    const auto frame = Parse<int>(word);
    if (!frame) return fmt::format("'{}' is not the number of a frame", word);
    if (*frame < 1 || *frame > frames) return std::string();  // of a longer sequence
    auto& entry = found[static_cast<std::size_t>(*frame - 1)];
    if (entry) return fmt::format("frame {} is there twice", *frame);
    entry = pose;
    return std::string();
  }));
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i]) return DataError("{}: frame {} of {} is missing", path.string(), i + 1, frames);
    poses.push_back(*found[i]);
  }
  return poses;
}

}  // namespace

Expected<void> WritePoseFolder(const PoseTable& poses, const std::vector<ObjectInfo>& objects,
                               const std::filesystem::path& folder) {
  TSDFPP_RETURN_IF_ERROR(WriteFile(folder / "gt-cam-0.txt", Lines(poses.T_WC)));
  for (const ObjectInfo& object : objects) {
    if (object.id == kBackground) continue;
    TSDFPP_RETURN_IF_ERROR(WriteFile(folder / FileName(object), Lines(poses.T_WO.at(object.id))));
  }
  return {};
}

Expected<PoseTable> ReadPoseFolder(const std::filesystem::path& folder,
                                   const std::vector<ObjectInfo>& objects, int frames) {
  PoseTable table;
  TSDFPP_ASSIGN(table.T_WC, ReadPoses(folder / "gt-cam-0.txt", frames));
  for (const ObjectInfo& object : objects) {
    if (object.id == kBackground) continue;
    TSDFPP_ASSIGN(table.T_WO[object.id], ReadPoses(folder / FileName(object), frames));
  }
  return table;
}

Expected<std::vector<TimedPose>> ReadTumTrajectory(const std::filesystem::path& path) {
  std::vector<TimedPose> poses;
  TSDFPP_RETURN_IF_ERROR(ForEachPose(path, [&](std::string_view word, const Pose& pose) {
    const auto time_s = Parse<double>(word);
    if (!time_s || !std::isfinite(*time_s)) return fmt::format("'{}' is not a time", word);
    if (!poses.empty() && !(*time_s > poses.back().time_s)) {
      return fmt::format("the time {} is not after the one before it", word);
    }
    poses.push_back({*time_s, pose});
    return std::string();
  }));
  if (poses.size() < 2) {
    return DataError("{}: has {} poses, expected two at least", path.string(), poses.size());
  }
  return poses;
}

Pose Interpolate(const Pose& a, const Pose& b, double part) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond(a.linear())
                      .slerp(part, Eigen::Quaterniond(b.linear()))
                      .normalized()
                      .toRotationMatrix();
  pose.translation() = (1 - part) * a.translation() + part * b.translation();
  return pose;
}

Pose PoseAt(const std::vector<Pose>& poses, double index) {
  const double last = static_cast<double>(poses.size()) - 1;
  const double at = std::clamp(index, 0.0, last);
  const double whole = std::floor(at);
  const auto i = static_cast<std::size_t>(whole);
  if (at == whole) return poses[i];
  return Interpolate(poses[i], poses[i + 1], at - whole);
}

}  // namespace tsdfpp
