#include "sequence/timed_poses.h"

#include <fmt/ranges.h>

#include <cmath>
#include <iterator>

#include "core/pose_text.h"
#include "sequence/text_lines.h"

namespace tsdfpp {

Expected<TimedPoses> ReadTimedPoses(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::vector<TextLine> lines, ReadTextLines(path));
  TimedPoses poses;
  for (const TextLine& line : lines) {
    const auto time_s = ParseNumber(line.words.front());
    if (!time_s || !std::isfinite(*time_s)) {
      return DataError("{}:{}: '{}' is not a time in seconds, expected t tx ty tz qx qy qz qw",
                       path.string(), line.number, line.words.front());
    }
    const auto pose =
        PoseFromText(fmt::format("{}", fmt::join(line.words.begin() + 1, line.words.end(), " ")));
    if (!pose) return DataError("{}:{}: {}", path.string(), line.number, pose.error().message);
    const auto [at, is_new] = poses.emplace(*time_s, *pose);
    if (!is_new && at->second.matrix() != pose->matrix()) {
      return DataError("{}:{}: time {} has a second, different pose", path.string(), line.number,
                       line.words.front());
    }
  }
  if (poses.empty()) return DataError("{}: holds no poses", path.string());
  return poses;
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
