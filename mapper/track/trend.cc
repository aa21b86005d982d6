#include "mapper/track/trend.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tsdfpp {
namespace {

// The t of one coordinate's slope over frames of equal distance.
double SlopeOverError(const Eigen::ArrayXd& values, double least_way_m) {
  const auto n = static_cast<double>(values.size());
  const Eigen::ArrayXd times = Eigen::ArrayXd::LinSpaced(values.size(), -(n - 1) / 2, (n - 1) / 2);
  const double squares = times.square().sum();
  const double slope = (times * values).sum() / squares;
  if (!(std::abs(slope) * (n - 1) > least_way_m)) return 0;
  const double left = (values - values.mean() - slope * times).square().sum();
  const double error = std::sqrt(left / (n - 2) / squares);
  return error > 0 ? std::abs(slope) / error : std::numeric_limits<double>::infinity();
}

}  // namespace

double TrendOf(std::span<const Vector6> places, const KnownDirections& known, double weak_share,
               double least_way_m) {
  if (places.size() < 3) return 0;
  double most = 0;
  Eigen::ArrayXd values(static_cast<Eigen::Index>(places.size()));
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (Eigen::Index k = 0; k < values.size(); ++k) {
      values[k] = places[static_cast<std::size_t>(k)].head<3>().dot(known.shifts.col(axis));
    }
    most = std::max(most, SlopeOverError(values, least_way_m));
    if (known.turn_shares[axis] < weak_share) continue;
    for (Eigen::Index k = 0; k < values.size(); ++k) {
      values[k] = places[static_cast<std::size_t>(k)].tail<3>().dot(known.turns.col(axis));
    }
    most = std::max(most, SlopeOverError(values, least_way_m));
  }
  return most;
}

}  // namespace tsdfpp
