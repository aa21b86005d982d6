#include "mapper/associate/reentry.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr std::size_t kModelPoints = 500;
constexpr std::size_t kCoarsePoints = 60;
constexpr int kCoarseSteps = 8;
constexpr int kFineSteps = 20;
constexpr double kFar = 6;              // voxels: what a point without a distance counts as
constexpr double kRobust = 2;           // voxels, where a residual counts half
constexpr double kOnSurface = 1;        // voxels
constexpr double kDepthSlack = 2;       // voxels between what should be seen and what is
constexpr double kFacing = -0.2;        // of the cosine of normal and viewing ray
constexpr std::size_t kLeastSeen = 20;  // model points, of a verification

// A vertex of the object's mesh where it was lost.
struct ModelPoint {
  Eigen::Vector3d p_W;
  Eigen::Vector3d normal_W;
};

std::vector<ModelPoint> ModelOf(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d p = mesh.vertices[a].cast<double>();
    const Eigen::Vector3d normal =
        (mesh.vertices[b].cast<double>() - p).cross(mesh.vertices[c].cast<double>() - p);
    for (const std::uint32_t corner : {a, b, c}) normals[corner] += normal;
  }
  std::vector<ModelPoint> all;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const double length = normals[i].norm();
    if (length > 0) all.push_back({mesh.vertices[i].cast<double>(), normals[i] / length});
  }
  const std::size_t count = std::min(all.size(), kModelPoints);
  std::vector<ModelPoint> model;
  for (std::size_t i = 0; i < count; ++i) model.push_back(all[i * all.size() / count]);
  return model;
}

// What an object's volume says at a point of the world's frame, where the object was lost.
struct Sample {
  double distance = 0;                                   // voxels
  Eigen::Vector3d gradient_W = Eigen::Vector3d::Zero();  // voxels a metre
  Eigen::Vector3d colour = Eigen::Vector3d::Zero();      // 0 to 1, where has_colour
  bool has_colour = false;
};

class Field {
 public:
  Field(const TsdfGrid& grid, const Pose& T_WL, double voxel_m)
      : reader_(grid), T_LW_(T_WL.inverse()), voxel_m_(voxel_m) {}

  std::optional<Sample> At(const Eigen::Vector3d& p_W, bool with_colour) const {
    const Eigen::Vector3d q = T_LW_ * p_W / voxel_m_;
    if (reader_.empty() || !(q.cwiseAbs().maxCoeff() < kFurthest)) return std::nullopt;
    const Corners corners = FindCorners(reader_, q);
    std::array<double, 8> distance{};
    for (std::size_t i = 0; i < 8; ++i) {
      const TsdfBlock* block = corners.block[i];
      const auto place = static_cast<std::size_t>(corners.place[i]);
      if (block == nullptr || !(block->weight[place] > 0)) return std::nullopt;
      distance[i] = static_cast<double>(static_cast<float>(block->distance[place])) / voxel_m_;
    }
    Sample sample;
    Eigen::Vector3d gradient_L = Eigen::Vector3d::Zero();
    double colours = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      double coefficient = 1;
      Eigen::Vector3d slope = Eigen::Vector3d::Ones();
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto f = static_cast<double>(corners.fraction[axis]);
        const bool upper = ((i >> axis) & 1U) != 0;
        const double own = upper ? f : 1 - f;
        coefficient *= own;
        for (std::size_t other = 0; other < 3; ++other) {
          slope[static_cast<Eigen::Index>(other)] *= other == axis ? (upper ? 1 : -1) : own;
        }
      }
      sample.distance += coefficient * distance[i];
      gradient_L += slope * distance[i];
      if (!with_colour) continue;
      const auto place = static_cast<std::size_t>(corners.place[i]);
      if (corners.block[i]->ColourCount(place) == 0) continue;
      const Colour colour = corners.block[i]->ColourAt(corners.place[i]);
      for (int c = 0; c < 3; ++c) {
        sample.colour[c] += coefficient * colour[static_cast<std::size_t>(c)] / 255.0;
      }
      colours += coefficient;
    }
    sample.gradient_W = T_LW_.linear().transpose() * gradient_L / voxel_m_;
    sample.has_colour = colours > 0;
    if (sample.has_colour) sample.colour /= colours;
    return sample;
  }

 private:
  static constexpr double kFurthest = double{kBlockSide} * (kFurthestBlock + 1);

  VoxelReader reader_;
  Pose T_LW_;
  double voxel_m_;
};

std::vector<Eigen::Vector3d> Thinned(const std::vector<Eigen::Vector3d>& points, std::size_t most) {
  const std::size_t count = std::min(points.size(), most);
  std::vector<Eigen::Vector3d> thinned;
  for (std::size_t i = 0; i < count; ++i) thinned.push_back(points[i * points.size() / count]);
  return thinned;
}

// Directions spread evenly over a sphere (a Fibonacci lattice), each with turns about it.
std::vector<Eigen::Matrix3d> RotationsAllAround(int directions, int turns) {
  std::vector<Eigen::Matrix3d> rotations;
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int i = 0; i < directions; ++i) {
    const double z = 1 - (2.0 * i + 1) / directions;
    const double radius = std::sqrt(1 - z * z);
    const Eigen::Vector3d direction(radius * std::cos(golden * i), radius * std::sin(golden * i),
                                    z);
    const Eigen::Quaterniond tilt =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction);
    for (int k = 0; k < turns; ++k) {
      const Eigen::AngleAxisd turn(2 * std::numbers::pi * k / turns, Eigen::Vector3d::UnitZ());
      rotations.push_back((tilt * turn).toRotationMatrix());
    }
  }
  return rotations;
}

// A place that is looked at: T takes the segment's points to where the object was lost.
struct Place {
  Pose T_lost_now = Pose::Identity();
  double cost = 0;  // voxels
};

class Search {
 public:
  Search(const Field& field, const std::vector<ModelPoint>& model, const Frame& frame,
         const SeenSegment& segment, double voxel_m, const ReentryConfig& config)
      : field_(field),
        model_(model),
        frame_(frame),
        segment_(segment),
        voxel_m_(voxel_m),
        config_(config),
        coarse_W_(Thinned(segment.points_W, kCoarsePoints)),
        fine_W_(Thinned(segment.points_W, static_cast<std::size_t>(config.max_points))) {
    for (const Eigen::Vector3d& p_W : fine_W_) centroid_W_ += p_W;
    centroid_W_ /= static_cast<double>(fine_W_.size());
  }

  std::optional<Reentry> Find() const {
    std::vector<Place> places = FirstPlaces();
    Keep(static_cast<std::size_t>(config_.refined), places);
    for (Place& place : places) {
      for (int i = 0; i < kCoarseSteps; ++i) Step(coarse_W_, place);
      place.cost = CostOf(fine_W_, place.T_lost_now);
    }
    Keep(kFinal, places);
    std::optional<Reentry> best;
    for (Place& place : places) {
      for (int i = 0; i < kFineSteps; ++i) Step(fine_W_, place);
      const std::optional<Reentry> found = Verify(place.T_lost_now);
      if (found && (!best || found->Score() > best->Score())) best = found;
    }
    return best;
  }

 private:
  static constexpr std::size_t kFinal = 6;

  static void Keep(std::size_t count, std::vector<Place>& places) {
    std::stable_sort(places.begin(), places.end(),
                     [](const Place& a, const Place& b) { return a.cost < b.cost; });
    if (places.size() > count) places.resize(count);
  }

  double CostOf(const std::vector<Eigen::Vector3d>& points_W, const Pose& T_lost_now) const {
    double sum = 0;
    for (const Eigen::Vector3d& p_W : points_W) {
      const auto sample = field_.At(T_lost_now * p_W, false);
      sum += sample ? std::min(std::abs(sample->distance), kFar) : kFar;
    }
    return sum / static_cast<double>(points_W.size());
  }

  // Each rotation with the part of the model that would then face the camera on the segment.
  std::vector<Place> FirstPlaces() const {
    const Eigen::Vector3d view_W = (centroid_W_ - frame_.T_WC.translation()).normalized();
    std::vector<Place> places;
    for (const Eigen::Matrix3d& R_now_lost :
         RotationsAllAround(config_.directions, config_.turns)) {
      const Eigen::Vector3d view_lost = R_now_lost.transpose() * view_W;
      Eigen::Vector3d middle = Eigen::Vector3d::Zero();
      int count = 0;
      for (const ModelPoint& point : model_) {
        if (point.normal_W.dot(view_lost) > kFacing) continue;
        middle += point.p_W;
        ++count;
      }
      if (count == 0) continue;
      Place place;
      place.T_lost_now.linear() = R_now_lost.transpose();
      place.T_lost_now.translation() = middle / count - place.T_lost_now.linear() * centroid_W_;
      place.cost = CostOf(coarse_W_, place.T_lost_now);
      places.push_back(place);
    }
    return places;
  }

  // A step of Gauss-Newton on the distances of the points, with Cauchy's weights.
  void Step(const std::vector<Eigen::Vector3d>& points_W, Place& place) const {
    Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6d b = Vector6d::Zero();
    const Eigen::Vector3d centre = place.T_lost_now * centroid_W_;
    int known = 0;
    for (const Eigen::Vector3d& p_W : points_W) {
      const Eigen::Vector3d q = place.T_lost_now * p_W;
      const auto sample = field_.At(q, false);
      if (!sample) continue;
      // In voxels, about the segment's middle, so that turns and shifts are alike.
      const Eigen::Vector3d g = sample->gradient_W * voxel_m_;
      const Eigen::Vector3d arm = (q - centre) / voxel_m_;
      Vector6d J;
      J << arm.cross(g), g;
      const double weight = 1 / (1 + std::pow(sample->distance / kRobust, 2));
      A += weight * J * J.transpose();
      b += weight * sample->distance * J;
      ++known;
    }
    if (known < 6) return;
    A.diagonal().array() += 1e-6 * A.diagonal().maxCoeff() + 1e-9;
    const Vector6d x = -A.ldlt().solve(b);
    if (!x.allFinite()) return;
    const double angle = std::min(x.head<3>().norm(), 0.5);
    Pose step = Pose::Identity();
    if (angle > 0) {
      step.linear() = Eigen::AngleAxisd(angle, x.head<3>().normalized()).toRotationMatrix();
    }
    step.translation() = centre + voxel_m_ * x.tail<3>() - step.linear() * centre;
    place.T_lost_now = step * place.T_lost_now;
    place.T_lost_now.linear() =
        Eigen::Quaterniond(place.T_lost_now.linear()).normalized().toRotationMatrix();
  }

  // How the points lie on the surface, and how their colours are like the model's.
  void CompareSegment(const Pose& T_lost_now, Reentry& found) const {
    const std::size_t count =
        std::min(segment_.pixels.size(), static_cast<std::size_t>(config_.max_points));
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> colours;  // the frame's, the model's
    int on_surface = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t k = i * segment_.pixels.size() / count;
      const Eigen::Vector3d& p_W = segment_.points_W[k];
      const auto sample = field_.At(T_lost_now * p_W, true);
      const Eigen::Vector3d view =
          T_lost_now.linear() * (p_W - frame_.T_WC.translation()).normalized();
      if (!sample || std::abs(sample->distance) > kOnSurface || sample->gradient_W.dot(view) > 0) {
        continue;
      }
      ++on_surface;
      if (!sample->has_colour) continue;
      const int pixel = segment_.pixels[k];
      const auto& seen =
          frame_.colour.at<cv::Vec3b>(pixel / frame_.colour.cols, pixel % frame_.colour.cols);
      colours.emplace_back(Eigen::Vector3d(seen[0], seen[1], seen[2]) / 255.0, sample->colour);
    }
    found.on_surface = static_cast<double>(on_surface) / static_cast<double>(count);
    // Light that falls from elsewhere is a common factor.
    double both = 0;
    double own = 0;
    for (const auto& [seen, known] : colours) {
      both += seen.dot(known);
      own += known.squaredNorm();
    }
    const double gain = own > 0 ? std::clamp(both / own, 0.5, 2.0) : 1;
    double sum = 0;
    for (const auto& [seen, known] : colours) sum += (seen - gain * known).cwiseAbs().mean();
    found.colour = colours.empty() ? 0 : sum / static_cast<double>(colours.size());
  }

  // Of the model's points that should be seen, the share that is: the pixel is the segment's and as
  // deep. Hidden by something nearer, or out of the image, says nothing.
  double SeenShare(const Pose& T_now_lost) const {
    const Pose T_CW = frame_.T_WC.inverse();
    const Intrinsics& camera = frame_.intrinsics;
    const double slack_m = kDepthSlack * voxel_m_;
    std::size_t seen = 0;
    std::size_t not_seen = 0;
    for (const ModelPoint& point : model_) {
      const Eigen::Vector3d p_C = T_CW * (T_now_lost * point.p_W);
      const Eigen::Vector3d normal_C = T_CW.linear() * (T_now_lost.linear() * point.normal_W);
      if (p_C.z() <= 0 || normal_C.dot(p_C.normalized()) > kFacing) continue;
      const int u = static_cast<int>(std::floor(camera.fx * p_C.x() / p_C.z() + camera.cx + 0.5));
      const int v = static_cast<int>(std::floor(camera.fy * p_C.y() / p_C.z() + camera.cy + 0.5));
      if (u < 0 || v < 0 || u >= camera.width || v >= camera.height) continue;
      const auto depth = static_cast<double>(frame_.depth.at<float>(v, u));
      if (!IsValidDepth(frame_.depth.at<float>(v, u)) || depth < p_C.z() - slack_m) continue;
      const bool of_segment =
          std::binary_search(segment_.pixels.begin(), segment_.pixels.end(), v * camera.width + u);
      if (depth > p_C.z() + slack_m) {
        ++not_seen;
      } else if (of_segment) {
        ++seen;
      }
    }
    if (seen + not_seen < kLeastSeen) return 0;
    return static_cast<double>(seen) / static_cast<double>(seen + not_seen);
  }

  std::optional<Reentry> Verify(const Pose& T_lost_now) const {
    Reentry found;
    found.T_now_lost = T_lost_now.inverse();
    CompareSegment(T_lost_now, found);
    if (found.on_surface < config_.min_on_surface || found.colour > config_.max_colour) {
      return std::nullopt;
    }
    found.seen = SeenShare(found.T_now_lost);
    if (found.seen < config_.min_seen) return std::nullopt;
    return found;
  }

  const Field& field_;
  const std::vector<ModelPoint>& model_;
  const Frame& frame_;
  const SeenSegment& segment_;
  double voxel_m_;
  const ReentryConfig& config_;
  std::vector<Eigen::Vector3d> coarse_W_;
  std::vector<Eigen::Vector3d> fine_W_;
  Eigen::Vector3d centroid_W_ = Eigen::Vector3d::Zero();
};

}  // namespace

std::optional<Reentry> FindReentry(const MapRepresentation& map, InstanceId id, const Frame& frame,
                                   const SeenSegment& segment, double reach_m,
                                   const ReentryConfig& config) {
  const TsdfGrid* grid = map.GridOf(id);
  if (IsOneField(map.method()) || grid == nullptr || segment.pixels.empty()) return std::nullopt;
  const std::vector<ModelPoint> model = ModelOf(map.ObjectMesh(id));
  if (model.size() < kLeastSeen) return std::nullopt;
  Eigen::AlignedBox3d box;
  for (const ModelPoint& point : model) box.extend(point.p_W);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p_W : segment.points_W) middle += p_W;
  middle /= static_cast<double>(segment.points_W.size());
  if ((middle - box.center()).norm() > reach_m + box.diagonal().norm()) return std::nullopt;
  const Field field(*grid, map.ObjectLattice(id), map.config().voxel_m);
  return Search(field, model, frame, segment, map.config().voxel_m, config).Find();
}

}  // namespace tsdfpp
