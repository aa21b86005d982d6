#include "sequence/calibration.h"

#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

#include "core/files.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

Expected<Intrinsics> Read(const fs::path& path, bool signed_fy) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path, &Limits::text_bytes));
  std::vector<double> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto skip_blanks = [&] {
    while (at != end && std::string_view(" \t\r\n").find(*at) != std::string_view::npos) ++at;
  };
  for (skip_blanks(); at != end; skip_blanks()) {
    double number = 0;
    const auto [next, status] = std::from_chars(at, end, number);
    if (status != std::errc() || !std::isfinite(number)) {
      return DataError("{}: number {} cannot be read, expected fx fy cx cy [width height]",
                       path.string(), numbers.size() + 1);
    }
    numbers.push_back(number);
    at = next;
  }
  if (numbers.size() != 4 && numbers.size() != 6) {
    return DataError("{}: {} numbers, expected fx fy cx cy [width height]", path.string(),
                     numbers.size());
  }
  Intrinsics camera{0, 0, numbers[0], numbers[1], numbers[2], numbers[3]};
  const double fy = signed_fy ? std::abs(camera.fy) : camera.fy;
  if (!(camera.fx > 0) || !(fy > 0)) {
    return DataError("{}: focal lengths {} and {}, expected both over 0", path.string(), camera.fx,
                     camera.fy);
  }
  if (numbers.size() == 6) {
    constexpr double kLargestSide_px = 16384;
    for (const double side : {numbers[4], numbers[5]}) {
      if (side < 1 || side > kLargestSide_px || side != std::floor(side)) {
        return DataError("{}: image size {} x {}, expected whole numbers from 1 to {}",
                         path.string(), numbers[4], numbers[5], kLargestSide_px);
      }
    }
    camera.width = static_cast<int>(numbers[4]);
    camera.height = static_cast<int>(numbers[5]);
  }
  return camera;
}

}  // namespace

Expected<Intrinsics> ReadCalibration(const fs::path& path) { return Read(path, false); }

Expected<Intrinsics> ReadSignedCalibration(const fs::path& path) { return Read(path, true); }

std::string CalibrationToText(const Intrinsics& camera) {
  return fmt::format("{} {} {} {} {} {}\n", camera.fx, camera.fy, camera.cx, camera.cy,
                     camera.width, camera.height);
}

}  // namespace tsdfpp
