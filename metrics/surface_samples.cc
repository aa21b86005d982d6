#include "metrics/surface_samples.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "core/units.h"
#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

using Piece = std::array<Eigen::Vector3d, 3>;

// Walks along the area of a sequence of triangles and drops a sample in each equal stretch.
class Sampler {
 public:
  Sampler(SampleSet& out, double total_m2, std::size_t count, std::uint64_t seed,
          std::uint32_t stream, std::uint16_t region)
      : out_(out),
        step_m2_(total_m2 / static_cast<double>(count)),
        count_(count),
        seed_(seed),
        stream_(stream),
        region_(region) {
    Draw();
  }

  void Add(const TriangleMesh& mesh, std::size_t triangle) {
    const Eigen::Vector3d area = AreaVector(mesh, triangle);
    const double area_m2 = area.norm();
    if (!(area_m2 > 0)) return;
    triangle_ = static_cast<std::uint32_t>(triangle);
    normal_ = (area / area_m2).cast<float>();
    last_ = {Corner(mesh, triangle, 0).cast<double>(), Corner(mesh, triangle, 1).cast<double>(),
             Corner(mesh, triangle, 2).cast<double>()};
    Cut(last_, area_m2);
  }

  // Rounding may leave the last stretch a hair beyond the walked area.
  void Finish() {
    while (made_ < count_) Drop(last_);
  }

 private:
  void Cut(const Piece& piece, double area_m2) {
    if (made_ == count_ || walked_m2_ + area_m2 <= threshold_m2_) {
      walked_m2_ += area_m2;
      return;
    }
    if (area_m2 <= step_m2_) {
      walked_m2_ += area_m2;
      while (made_ < count_ && threshold_m2_ < walked_m2_) Drop(piece);
      return;
    }
    std::size_t longest = 0;
    double longest2 = -1;
    for (std::size_t k = 0; k < 3; ++k) {
      const double length2 = (piece[(k + 1) % 3] - piece[k]).squaredNorm();
      if (length2 > longest2) {
        longest2 = length2;
        longest = k;
      }
    }
    const Eigen::Vector3d& a = piece[longest];
    const Eigen::Vector3d& b = piece[(longest + 1) % 3];
    const Eigen::Vector3d& c = piece[(longest + 2) % 3];
    const Eigen::Vector3d middle = 0.5 * (a + b);
    Cut({a, middle, c}, 0.5 * area_m2);
    Cut({middle, b, c}, 0.5 * area_m2);
  }

  void Drop(const Piece& piece) {
    const double root = std::sqrt(draw_[1]);
    const Eigen::Vector3d point =
        (1 - root) * piece[0] + root * (1 - draw_[2]) * piece[1] + root * draw_[2] * piece[2];
    out_.points.emplace_back(point.cast<float>());
    out_.normals.push_back(normal_);
    out_.region.push_back(region_);
    out_.triangle.push_back(triangle_);
    out_.area_m2.push_back(static_cast<float>(step_m2_));
    ++made_;
    Draw();
  }

  void Draw() {
    draw_ = UniformDraw(seed_, stream_, made_, region_);
    threshold_m2_ = (static_cast<double>(made_) + draw_[0]) * step_m2_;
  }

  SampleSet& out_;
  double step_m2_;
  std::size_t count_;
  std::uint64_t seed_;
  std::uint32_t stream_;
  std::uint16_t region_;

  std::size_t made_ = 0;
  double walked_m2_ = 0;
  double threshold_m2_ = 0;
  std::array<double, 4> draw_{};
  std::uint32_t triangle_ = 0;
  Eigen::Vector3f normal_ = Eigen::Vector3f::Zero();
  Piece last_{};
};

template <typename Belongs>
void SampleFaces(const TriangleMesh& mesh, const Belongs& belongs, double per_cm2,
                 std::uint64_t seed, std::uint32_t stream, std::uint16_t region, SampleSet& out) {
  double total_m2 = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (belongs(t)) total_m2 += AreaVector(mesh, t).norm();
  }
  if (!(total_m2 > 0)) return;
  const long long wanted = std::llround(total_m2 * kCm2PerM2 * per_cm2);
  const auto count = static_cast<std::size_t>(std::max(1LL, wanted));
  Sampler sampler(out, total_m2, count, seed, stream, region);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (belongs(t)) sampler.Add(mesh, t);
  }
  sampler.Finish();
}

}  // namespace

SampleSet SampleMesh(const TriangleMesh& mesh, double per_cm2, std::uint64_t seed,
                     std::uint32_t stream) {
  SampleSet out;
  SampleFaces(
      mesh, [](std::size_t) { return true; }, per_cm2, seed, stream, 0, out);
  return out;
}

SampleSet SampleModel(const TrueModel& model, const SampleConfig& config) {
  SampleSet out;
  for (std::size_t r = 0; r < model.regions.size(); ++r) {
    const auto& fine_regions = config.fine_background_regions;
    const bool fine =
        model.info.id != kBackground ||
        std::find(fine_regions.begin(), fine_regions.end(), model.regions[r]) != fine_regions.end();
    SampleFaces(
        model.mesh_O, [&](std::size_t t) { return model.face_region[t] == r; },
        fine ? config.fine_per_cm2 : config.coarse_per_cm2, config.seed, model.info.id,
        static_cast<std::uint16_t>(r), out);
  }
  return out;
}

SampleSet WithoutInner(const SampleSet& samples, const Solid& solid) {
  std::vector<Eigen::Vector3f> outward(samples.size());
  for (std::size_t i = 0; i < outward.size(); ++i) {
    outward[i] = samples.points[i] + static_cast<float>(kInnerOffset_m) * samples.normals[i];
  }
  const std::vector<std::uint8_t> inner = solid.Contains(outward);
  SampleSet kept;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (inner[i] != 0) continue;
    kept.points.push_back(samples.points[i]);
    kept.normals.push_back(samples.normals[i]);
    kept.region.push_back(samples.region[i]);
    kept.triangle.push_back(samples.triangle[i]);
    kept.area_m2.push_back(samples.area_m2[i]);
  }
  return kept;
}

std::vector<Eigen::Vector3f> TransformPoints(const Pose& T_target_source,
                                             const std::vector<Eigen::Vector3f>& points) {
  std::vector<Eigen::Vector3f> out;
  out.reserve(points.size());
  for (const auto& point : points) {
    out.emplace_back((T_target_source * point.cast<double>()).cast<float>());
  }
  return out;
}

std::vector<Eigen::Vector3f> TransformNormals(const Pose& T_target_source,
                                              const std::vector<Eigen::Vector3f>& normals) {
  const Eigen::Matrix3f R = T_target_source.linear().cast<float>();
  std::vector<Eigen::Vector3f> out;
  out.reserve(normals.size());
  for (const auto& normal : normals) out.emplace_back(R * normal);
  return out;
}

}  // namespace tsdfpp
