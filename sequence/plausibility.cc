#include "sequence/plausibility.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/units.h"

namespace tsdfpp {
namespace {

constexpr double kUnits[] = {1000, 5000, 6553.5, 10000};  // in use among datasets, per metre

// The median of the depths that are finite and over 0, and over 100 m too: those of a wrong unit.
std::optional<double> MedianDepth(const cv::Mat& depth) {
  constexpr int kStep = 4;
  constexpr std::size_t kFewest = 50;
  std::vector<float> depths;
  for (int y = 0; y < depth.rows; y += kStep) {
    for (int x = 0; x < depth.cols; x += kStep) {
      const float z = depth.at<float>(y, x);
      if (std::isfinite(z) && z > 0) depths.push_back(z);
    }
  }
  if (depths.size() < kFewest) return std::nullopt;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

Expected<void> CheckRange(const Frame& frame, const std::string& name, double units_per_m) {
  const auto median = MedianDepth(frame.depth);
  if (!median || (*median >= kNearestMedian_m && *median <= kFarthestMedian_m)) return {};
  std::string fitting;
  constexpr double kRoom_m[] = {0.2, 10};
  for (const double units : kUnits) {
    const double other = *median * units_per_m / units;
    if (other < kRoom_m[0] || other > kRoom_m[1]) continue;
    fitting +=
        fmt::format("{}{:g} would give {:.2f} m", fitting.empty() ? "; " : ", ", units, other);
  }
  return DataError(
      "{}: the median depth of frame {} is {:.3g} m at {:g} units a metre, expected {:g} to {:g} "
      "m: another unit{}",
      name, frame.index, *median, units_per_m, kNearestMedian_m, kFarthestMedian_m, fitting);
}

struct Pair {
  const Frame* from;
  const Frame* to;
};

// What may be wrong: how poses and depth would have to be changed.
struct Explanation {
  std::function<Pose(const Pose&)> pose;
  double depth_scale = 1;
  std::string sentence;  // after "the ..."
};

// The share of the pixels of `from` that agree with what `to` measured; adds the number compared.
double Agreement(const Pair& pair, const Explanation& explanation, long& compared) {
  constexpr int kSamplesAcross = 80;
  const Frame& from = *pair.from;
  const Frame& to = *pair.to;
  const Pose T_to_from = explanation.pose(to.T_WC).inverse() * explanation.pose(from.T_WC);
  const int step = std::max(1, from.depth.cols / kSamplesAcross);
  long valid = 0;
  long agree = 0;
  for (int y = step / 2; y < from.depth.rows; y += step) {
    for (int x = step / 2; x < from.depth.cols; x += step) {
      const double z = explanation.depth_scale * from.depth.at<float>(y, x);
      if (!(z > 0) || z > kMaxValidDepth_m) continue;
      ++valid;
      const Eigen::Vector3d p_from((x - from.intrinsics.cx) / from.intrinsics.fx * z,
                                   (y - from.intrinsics.cy) / from.intrinsics.fy * z, z);
      const Eigen::Vector3d p = T_to_from * p_from;
      if (p.z() <= 0) continue;
      const double u = to.intrinsics.fx * p.x() / p.z() + to.intrinsics.cx;
      const double v = to.intrinsics.fy * p.y() / p.z() + to.intrinsics.cy;
      if (!(u > -0.5 && v > -0.5 && u < to.depth.cols - 0.5 && v < to.depth.rows - 0.5)) continue;
      const double seen =
          explanation.depth_scale *
          to.depth.at<float>(static_cast<int>(std::lround(v)), static_cast<int>(std::lround(u)));
      // A hole says nothing for or against.
      if (!(seen > 0)) {
        --valid;
      } else if (std::abs(p.z() - seen) < kAgreement * p.z()) {
        ++agree;
      }
    }
  }
  compared += valid;
  return valid > 0 ? static_cast<double>(agree) / static_cast<double>(valid) : 0;
}

// Mean over the pairs.
double Agreement(const std::vector<Pair>& pairs, const Explanation& explanation, long& compared) {
  double sum = 0;
  for (const Pair& pair : pairs) sum += Agreement(pair, explanation, compared);
  return sum / static_cast<double>(pairs.size());
}

Explanation AsItIs() {
  return {[](const Pose& T) { return T; }, 1, ""};
}

std::vector<Explanation> Explanations(std::optional<double> units_per_m) {
  std::vector<Explanation> all = {
      {[](const Pose& T) { return T.inverse(); }, 1,
       "camera poses look inverted (world-to-camera), expected camera-to-world"},
      {[](const Pose& T) {
         Pose turned = T;
         turned.linear() = T.linear() * Eigen::DiagonalMatrix<double, 3>(1, -1, -1);
         return turned;
       },
       1, "cameras look along -z with y up (OpenGL's axes), expected +z forward and y down"},
      {[](const Pose& T) {
         Pose shorter = T;
         shorter.translation() *= 0.001;
         return shorter;
       },
       1, "camera positions look like millimetres, expected metres"}};
  for (const double units : kUnits) {
    if (!units_per_m || std::abs(units / *units_per_m - 1) < 0.01) continue;
    all.push_back({AsItIs().pose, *units_per_m / units,
                   fmt::format("depth looks like {:g} units a metre, it was read as {:g}", units,
                               *units_per_m)});
  }
  return all;
}

struct Motion {
  double angle = 0;  // radians
  double distance_m = 0;
};
// Depth in a wrong unit agrees with itself over a short way round what is looked at; over a longer
// one it does not. Small motion tells where frames that are far apart have little in common.
constexpr Motion kWide{15 * kDegree, 0.3};
constexpr Motion kNarrow{4 * kDegree, 0.05};
constexpr std::size_t kFewestPairs = 2;

// Frames with enough motion between them to tell: the first later one that is turned or moved by
// `least`, if it is not turned by more than 30 degrees. Beginnings are spread evenly.
std::vector<std::pair<std::size_t, std::size_t>> MovedPairs(const std::vector<Pose>& T_WC,
                                                            const Motion& least) {
  constexpr std::size_t kPairs = 4;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t k = 0; k < kPairs; ++k) {
    const std::size_t i = k * T_WC.size() / kPairs;
    if (k > 0 && i == (k - 1) * T_WC.size() / kPairs) continue;
    for (std::size_t j = i + 1; j < T_WC.size(); ++j) {
      const Pose motion = T_WC[i].inverse() * T_WC[j];
      const double angle = Eigen::AngleAxisd(motion.linear()).angle();
      if (angle < least.angle && motion.translation().norm() < least.distance_m) continue;
      if (angle < 30 * kDegree) pairs.emplace_back(i, j);
      break;
    }
  }
  return pairs;
}

// Errors: kData where the frames agree far better if something is read in another way.
Expected<void> CheckAgreement(const std::vector<Pair>& pairs, const std::string& name,
                              std::optional<double> units_per_m) {
  constexpr long kFewestPixels = 500;
  long compared = 0;
  const double as_it_is = Agreement(pairs, AsItIs(), compared);
  double best = 0;
  Explanation likeliest;
  for (const Explanation& explanation : Explanations(units_per_m)) {
    compared = 0;
    const double share = Agreement(pairs, explanation, compared);
    if (compared < kFewestPixels || share <= best) continue;
    best = share;
    likeliest = explanation;
  }
  if (best < kClearShare || best < kClearRatio * as_it_is) return {};
  return DataError(
      "{}: the {} ({:.0f} % of the depth agrees between frames that way, {:.0f} % as "
      "it is)",
      name, likeliest.sentence, 100 * best, 100 * as_it_is);
}

}  // namespace

Expected<void> CheckCamera(const Intrinsics& camera, const std::string& where) {
  constexpr double kShortest = 0.2;
  constexpr double kLongest = 10;
  for (const double f : {camera.fx, camera.fy}) {
    if (!(f >= kShortest * camera.width && f <= kLongest * camera.width)) {
      return DataError(
          "{}: focal lengths {:g} and {:g} do not fit an image {} pixels wide, "
          "expected {:g} to {:g}",
          where, camera.fx, camera.fy, camera.width, kShortest * camera.width,
          kLongest * camera.width);
    }
  }
  const double off_x = std::abs(camera.cx - (camera.width - 1) / 2.0) / camera.width;
  const double off_y = std::abs(camera.cy - (camera.height - 1) / 2.0) / camera.height;
  if (!(off_x <= kFarthestPrincipalPoint && off_y <= kFarthestPrincipalPoint)) {
    return DataError(
        "{}: the principal point ({:g}, {:g}) is far from the middle of the {}x{} image: "
        "intrinsics of another resolution",
        where, camera.cx, camera.cy, camera.width, camera.height);
  }
  return {};
}

Expected<void> CheckPossibleCamera(const Intrinsics& camera, const std::string& where) {
  const auto is_side = [](int side) { return side >= 1 && side <= kLargestCameraSide_px; };
  if (!is_side(camera.width) || !is_side(camera.height)) {
    return DataError("{}: images of {}x{} pixels, expected sides from 1 to {}", where, camera.width,
                     camera.height, kLargestCameraSide_px);
  }
  const bool finite = std::isfinite(camera.fx) && std::isfinite(camera.fy) &&
                      std::isfinite(camera.cx) && std::isfinite(camera.cy);
  if (!finite || !(camera.fx > 0) || !(camera.fy > 0)) {
    return DataError(
        "{}: focal lengths {:g} and {:g} and principal point ({:g}, {:g}), expected finite numbers "
        "and focal lengths above 0",
        where, camera.fx, camera.fy, camera.cx, camera.cy);
  }
  return {};
}

Expected<void> CheckFrames(FrameSource& source, const std::vector<Pose>& T_WC,
                           std::optional<double> units_per_m) {
  const SequenceInfo& info = source.info();
  std::map<std::size_t, Frame> frames;
  const auto read = [&](std::size_t i) -> const Frame* {
    const auto known = frames.find(i);
    if (known != frames.end()) return &known->second;
    auto frame = source.Read(info.first_index + static_cast<int>(i));
    return frame ? &frames.emplace(i, std::move(*frame)).first->second : nullptr;
  };
  if (units_per_m) {
    const Frame* first = read(0);
    if (first != nullptr) TSDFPP_RETURN_IF_ERROR(CheckRange(*first, info.name, *units_per_m));
  }
  for (const Motion& least : {kWide, kNarrow}) {
    std::vector<Pair> pairs;
    for (const auto& [i, j] : MovedPairs(T_WC, least)) {
      const Frame* from = read(i);
      const Frame* to = read(j);
      if (from == nullptr || to == nullptr) continue;
      if (units_per_m) TSDFPP_RETURN_IF_ERROR(CheckRange(*from, info.name, *units_per_m));
      pairs.push_back({from, to});
    }
    if (pairs.size() >= kFewestPairs) {
      TSDFPP_RETURN_IF_ERROR(CheckAgreement(pairs, info.name, units_per_m));
    }
  }
  return {};
}

}  // namespace tsdfpp
