#include "sequence/trajectory_file.h"

#include <charconv>
#include <string_view>

#include "core/files.h"
#include "core/pose_text.h"

namespace tsdfpp {
namespace {

constexpr std::string_view kBlanks = " \t\r";

}  // namespace

std::string TrajectoryToText(const Trajectory& trajectory, const std::string& what) {
  std::string text = fmt::format("# frame tx ty tz qx qy qz qw (T_world_{})\n", what);
  for (const auto& [frame, pose] : trajectory) {
    text += fmt::format("{} {}\n", frame, PoseToText(pose));
  }
  return text;
}

Expected<Trajectory> ReadTrajectory(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path, &Limits::text_bytes));
  Trajectory trajectory;
  std::string_view rest = text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = rest.find('\n');
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    if (line.empty() || line.front() == '#') continue;

    int frame = 0;
    const auto [next, status] = std::from_chars(line.data(), line.data() + line.size(), frame);
    line.remove_prefix(static_cast<std::size_t>(next - line.data()));
    if (status != std::errc() || (!line.empty() && line.front() != ' ' && line.front() != '\t')) {
      return DataError("{}:{}: the line does not begin with a whole frame number", path.string(),
                       number);
    }
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    while (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    auto pose = PoseFromText(line);
    if (!pose) return DataError("{}:{}: {}", path.string(), number, pose.error().message);
    if (!trajectory.emplace(frame, *pose).second) {
      return DataError("{}:{}: frame {} has a second pose", path.string(), number, frame);
    }
  }
  return trajectory;
}

}  // namespace tsdfpp
