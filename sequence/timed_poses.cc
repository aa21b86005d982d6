#include "sequence/timed_poses.h"

#include <fmt/ranges.h>

#include <cmath>
#include <iterator>

#include "core/pose_text.h"
#include "sequence/text_lines.h"

namespace tsdfpp {
namespace {

// How many lines there are of a kind, and the first of them.
struct OddLines {
  int count = 0;
  int first = 0;
  std::string what;

  void Add(int line, std::string what_it_is) {
    if (count++ > 0) return;
    first = line;
    what = std::move(what_it_is);
  }
};

}  // namespace

Expected<TimedPoses> ReadTimedPoses(const std::filesystem::path& path,
                                    std::vector<std::string>* remarks) {
  TSDFPP_ASSIGN(const std::vector<TextLine> lines, ReadTextLines(path));
  TimedPoses poses;
  OddLines repeated;
  OddLines backwards;
  int differing = 0;
  const std::string* before = nullptr;
  double before_s = 0;
  for (const TextLine& line : lines) {
    const auto time_s = ParseNumber(line.words.front());
    if (!time_s || !std::isfinite(*time_s)) {
      return DataError("{}:{}: '{}' is not a time in seconds, expected t tx ty tz qx qy qz qw",
                       path.string(), line.number, line.words.front());
    }
    const auto pose =
        PoseFromText(fmt::format("{}", fmt::join(line.words.begin() + 1, line.words.end(), " ")));
    if (!pose) return DataError("{}:{}: {}", path.string(), line.number, pose.error().message);
    if (const auto [at, is_new] = poses.emplace(*time_s, *pose); !is_new) {
      if (at->second.matrix() != pose->matrix()) ++differing;
      at->second = *pose;
      repeated.Add(line.number, fmt::format("time {}", line.words.front()));
    }
    if (before && *time_s < before_s) {
      backwards.Add(line.number, fmt::format("{} after {}", line.words.front(), *before));
    }
    before = &line.words.front();
    before_s = *time_s;
  }
  if (poses.empty()) return DataError("{}: holds no poses", path.string());
  if (remarks && repeated.count > 0) {
    remarks->push_back(
        fmt::format("{}: lines that repeat the time of an earlier one: {}, {} of them with another "
                    "pose, the first is line {} ({}); of a time the last line counts",
                    path.string(), repeated.count, differing, repeated.first, repeated.what));
  }
  if (remarks && backwards.count > 0) {
    remarks->push_back(
        fmt::format("{}: lines that go back in time: {}, the first is line {} ({}); poses are "
                    "taken in the order of their times",
                    path.string(), backwards.count, backwards.first, backwards.what));
  }
  return poses;
}

Expected<void> RemarkOnPoseOffset(const std::filesystem::path& path, double offset_s,
                                  std::vector<std::string>& remarks) {
  if (offset_s == 0) return {};
  std::error_code code;
  if (!std::filesystem::exists(path, code)) {
    return UsageError("{}: no such file, expected no offset of poses without it", path.string());
  }
  remarks.push_back(fmt::format("{}: read {:g} s {} the images' times", path.string(),
                                std::abs(offset_s), offset_s > 0 ? "after" : "before"));
  return {};
}

std::optional<Pose> PoseAt(const TimedPoses& poses, double time_s) {
  const auto after = poses.lower_bound(time_s);
  if (after != poses.end() && after->first == time_s) return after->second;
  if (after != poses.end() && after != poses.begin()) {
    const auto before = std::prev(after);
    const double gap_s = after->first - before->first;
    if (gap_s <= kLongestPoseGap_s) {
      const double share = (time_s - before->first) / gap_s;
      const Eigen::Quaterniond from(before->second.linear());
      const Eigen::Quaterniond to(after->second.linear());
      Pose pose = Pose::Identity();
      pose.linear() = from.slerp(share, to).normalized().toRotationMatrix();
      pose.translation() =
          (1 - share) * before->second.translation() + share * after->second.translation();
      return pose;
    }
  }
  const auto nearest = [&] {
    if (after == poses.end()) return std::prev(after);
    if (after == poses.begin()) return after;
    const auto before = std::prev(after);
    return time_s - before->first <= after->first - time_s ? before : after;
  };
  if (poses.empty()) return std::nullopt;
  const auto at = nearest();
  if (std::abs(at->first - time_s) > kAssociationLimit_s) return std::nullopt;
  return at->second;
}

}  // namespace tsdfpp
