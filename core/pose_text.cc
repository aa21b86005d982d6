#include "core/pose_text.h"

#include <charconv>
#include <cmath>

#include "core/farthest.h"

namespace tsdfpp {

namespace {

std::string Write(const Pose& T_target_source) {
  const Eigen::Vector3d t = T_target_source.translation();
  Eigen::Quaterniond q(T_target_source.linear());
  q.normalize();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  std::string text = fmt::format("{:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}", t.x(), t.y(),
                                 t.z(), q.x(), q.y(), q.z(), q.w());
  // Equal poses have equal text, whether a number was rounded to zero from above or from below.
  constexpr std::string_view kMinusZero = "-0.000000000";
  for (std::size_t at = text.find(kMinusZero); at != text.npos; at = text.find(kMinusZero, at)) {
    text.erase(at, 1);
  }
  return text;
}

}  // namespace

std::string PoseToText(const Pose& T_target_source) {
  // A rounded quaternion is not quite of unit length; normalising it when it is read may move a
  // number across a rounding edge. Each further trip brings the length closer to 1, so a text that
  // survives its own trip is soon found (two trips at most in practice).
  std::string text = Write(T_target_source);
  constexpr int kMostTrips = 10;
  for (int i = 0; i < kMostTrips; ++i) {
    const auto read = PoseFromText(text);
    if (!read) break;  // not a rigid transformation: the reader says what is wrong
    std::string again = Write(*read);
    if (again == text) break;
    text = std::move(again);
  }
  return text;
}

Expected<Pose> PoseFromText(std::string_view text) {
  std::array<double, 7> numbers{};
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  for (double& number : numbers) {
    while (at != end && (*at == ' ' || *at == '\t')) ++at;
    const auto [next, status] = std::from_chars(at, end, number);
    if (status != std::errc() || !std::isfinite(number)) {
      return DataError("'{}' is not a pose: expected seven numbers tx ty tz qx qy qz qw", text);
    }
    at = next;
  }
  while (at != end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
  if (at != end) {
    return DataError("'{}' is not a pose: more than the seven numbers tx ty tz qx qy qz qw", text);
  }
  Eigen::Quaterniond q(numbers[6], numbers[3], numbers[4], numbers[5]);
  constexpr double kLengthTolerance = 1e-3;
  if (std::abs(q.norm() - 1.0) > kLengthTolerance) {
    return DataError("'{}' is not a pose: the quaternion's length is {:.6f}, not 1", text,
                     q.norm());
  }
  for (const double metres : {numbers[0], numbers[1], numbers[2]}) {
    if (std::abs(metres) > kFarthest_m) {
      return DataError("'{}' is not a pose: {:g} m from the origin, expected at most {:g}", text,
                       std::abs(metres), kFarthest_m);
    }
  }
  q.normalize();
  Pose pose = Pose::Identity();
  pose.linear() = q.toRotationMatrix();
  pose.translation() = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  return pose;
}

Pose PoseThroughText(const Pose& T_target_source) {
  return PoseFromText(PoseToText(T_target_source)).value();
}

}  // namespace tsdfpp
