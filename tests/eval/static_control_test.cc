// The negative control: where nothing moves, all maps have to agree, Open3D's among them. What the
// experiment then finds between them comes from motion.
//
// Every fourth frame of scenes/static.toml is mapped (30 of 120), for time.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "mapper/map_representation.h"
#include "metrics/preservation.h"
#include "metrics/truth_surface.h"
#include "metrics/visibility.h"
#include "tests/eval/open3d_volume.h"
#include "tests/eval/seen_surface.h"
#include "tests/mapper/map_snapshot.h"

namespace tsdfpp {
namespace {

constexpr int kStep = 4;
// The criteria of the negative control, as the project's plan states them.
constexpr double kMeanDistance_voxels = 0.25;
constexpr double kFScoreDifference = 0.01;

MapConfig PaperConfig(int layers) {
  MapConfig config;
  EXPECT_TRUE(config.SetProfile("paper").has_value());
  config.layers = layers;
  return config;
}

std::unique_ptr<MapRepresentation> MapOf(Method method, int layers, const FrameSet& set) {
  auto map = MakeMap(method, PaperConfig(layers));
  for (const Frame& frame : set.frames) {
    for (const auto& [id, T_WO] : frame.T_WO) map->SetObjectPose(id, T_WO);
    map->Fuse(frame, frame.mask);
  }
  EXPECT_EQ(map->Objects().size(), set.info.objects.size());
  return map;
}

// F-score at one voxel against the truth: precision over the seen samples of the reconstruction,
// recall over the seen samples of the truth, labels ignored (Open3D has none).
class TruthScore {
 public:
  TruthScore(const FrameSet& set, double voxel_m) : voxel_m_(voxel_m) {
    for (const TrueModel& model : set.models) {
      const InstanceId id = model.info.id;
      SeenTracker& tracker = trackers_.emplace_back(SampleModel(model, SampleConfig{}), id);
      const auto given = set.frames.front().T_WO.find(id);
      T_WO_.push_back(given == set.frames.front().T_WO.end() ? Pose::Identity() : given->second);
      for (const Frame& frame : set.frames) {
        EXPECT_TRUE(tracker.Observe(frame, T_WO_.back()).has_value());
      }
      surfaces_.push_back(std::make_unique<TruthSurface>(model));
    }
  }

  double Precision(const SampleSet& seen_W) const {
    std::vector<PlacedTruth> placed;
    for (std::size_t i = 0; i < surfaces_.size(); ++i) {
      placed.push_back({surfaces_[i].get(), T_WO_[i]});
    }
    const NearestTruth nearest = FindNearestTruth(seen_W.points, placed);
    double good = 0;
    for (const float distance_m : nearest.distance_m) good += distance_m <= voxel_m_ ? 1 : 0;
    return good / static_cast<double>(seen_W.size());
  }

  double Recall(const SurfaceIndex& surface_W) const {
    double seen_m2 = 0;
    double good_m2 = 0;
    for (std::size_t i = 0; i < trackers_.size(); ++i) {
      const SampleSet& samples = trackers_[i].samples_O();
      const Selection seen = SelectSeen(trackers_[i], SelectAll(samples));
      Selection good =
          Reconstructed(MatchSamples(samples, seen, T_WO_[i], surface_W, voxel_m_), voxel_m_);
      seen_m2 += SelectedArea_m2(samples, seen);
      for (std::size_t k = 0; k < good.size(); ++k) good[k] = good[k] & seen[k];
      good_m2 += SelectedArea_m2(samples, good);
    }
    return good_m2 / seen_m2;
  }

 private:
  double voxel_m_;
  std::vector<SeenTracker> trackers_;
  std::vector<Pose> T_WO_;
  std::vector<std::unique_ptr<TruthSurface>> surfaces_;
};

// One map's surface: an index, and the samples of it that were seen.
struct Candidate {
  Candidate(std::string title, TriangleMesh mesh, const FrameSet& set, double margin_m)
      : name(std::move(title)), seen(SeenSamples(mesh, set.frames, margin_m)), index(mesh) {}
  std::string name;
  SampleSet seen;
  SurfaceIndex index;
};

TEST(StaticControl, AllMapsAndOpen3dAgree) {
  const auto set = ReadFrames("static", kStep);
  ASSERT_TRUE(set.has_value()) << set.error().message;
  const MapConfig config = PaperConfig(0);
  // A sheet within the band of what was measured counts as seen: wide enough to hold every fault
  // that a truncated field can have in front of a camera.
  const double margin_m = config.front();

  std::vector<Candidate> candidates;
  for (const Method method : {Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored}) {
    candidates.emplace_back(std::string(MethodName(method)),
                            MapOf(method, 0, *set)->SceneMesh(), *set, margin_m);
  }
  Open3dVolume open3d(config.voxel_m, config.front());
  for (const Frame& frame : set->frames) open3d.Integrate(frame);
  candidates.emplace_back("Open3D", open3d.Mesh(), *set, margin_m);

  for (const Candidate& a : candidates) {
    for (const Candidate& b : candidates) {
      if (&a == &b) continue;
      const double distance_voxels = MeanDistance_m(a.seen, b.index) / config.voxel_m;
      std::printf("mean distance %-14s to %-14s %.4f voxels (%zu samples)\n", a.name.c_str(),
                  b.name.c_str(), distance_voxels, a.seen.size());
      EXPECT_LE(distance_voxels, kMeanDistance_voxels) << a.name << " to " << b.name;
    }
  }
  const TruthScore truth(*set, config.voxel_m);
  double least = 1;
  double greatest = 0;
  for (const Candidate& candidate : candidates) {
    const double p = truth.Precision(candidate.seen);
    const double r = truth.Recall(candidate.index);
    const double f = 2 * p * r / (p + r);
    std::printf("%-14s precision %.4f recall %.4f F %.4f\n", candidate.name.c_str(), p, r, f);
    least = std::min(least, f);
    greatest = std::max(greatest, f);
  }
  EXPECT_LT(greatest - least, kFScoreDifference);
  EXPECT_GT(least, 0.9) << "maps that agree on a wrong surface prove nothing";
}

// Voxels and mesh of one object.
std::string ObjectBytes(const MapRepresentation& map, InstanceId id) {
  std::string bytes;
  for (const Eigen::Vector3i& v : map.ObservedVoxels(id)) {
    const auto value = map.ValueAt(id, v);
    for (int a = 0; a < 3; ++a) AppendBytes(v[a], bytes);
    AppendBytes(value->distance_m, bytes);
    AppendBytes(value->weight, bytes);
    AppendBytes(value->colour, bytes);
  }
  AppendMesh(map.ObjectMesh(id), bytes);
  return bytes;
}

TEST(StaticControl, TsdfppAndAnchoredHoldTheSameVolumes) {
  constexpr int kLayers = 4;
  const auto set = ReadFrames("static", kStep);
  ASSERT_TRUE(set.has_value()) << set.error().message;
  const auto plain = MapOf(Method::kTsdfpp, kLayers, *set);
  const auto anchored = MapOf(Method::kTsdfppAnchored, kLayers, *set);

  ASSERT_EQ(plain->Objects(), anchored->Objects());
  ASSERT_EQ(plain->Objects().size(), set->info.objects.size());
  for (const InstanceId id : plain->Objects()) {
    const std::string bytes = ObjectBytes(*plain, id);
    EXPECT_GT(bytes.size(), 100'000U) << "object " << id << " was hardly mapped";
    EXPECT_TRUE(bytes == ObjectBytes(*anchored, id)) << "object " << id;
  }

  // The same objects at every voxel; so where one object covers it, there is no order to differ in.
  const auto listed = plain->ListedVoxels();
  ASSERT_EQ(listed.size(), anchored->ListedVoxels().size());
  const auto ids_at = [](const MapRepresentation& map, const Eigen::Vector3i& v) {
    std::vector<InstanceId> ids;
    for (const Listing& entry : map.ListAt(v)) ids.push_back(entry.id);
    return ids;
  };
  std::size_t shared = 0;
  std::size_t reordered = 0;
  std::size_t different = 0;
  for (const Eigen::Vector3i& v : listed) {
    std::vector<InstanceId> a = ids_at(*plain, v);
    std::vector<InstanceId> b = ids_at(*anchored, v);
    shared += a.size() > 1 ? 1 : 0;
    reordered += a != b ? 1 : 0;
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    different += a != b ? 1 : 0;
  }
  std::printf("%zu voxels listed, %zu with several objects, %zu in another order\n", listed.size(),
              shared, reordered);
  EXPECT_EQ(different, 0U) << "voxels that list other objects";
  EXPECT_GT(shared, 0U);

  // All of the surface, not only what was seen last: both meshes come from the same volumes.
  const TriangleMesh plain_mesh = plain->SceneMesh();
  const TriangleMesh anchored_mesh = anchored->SceneMesh();
  const double voxel_m = PaperConfig(kLayers).voxel_m;
  const double there =
      MeanDistance_m(SampleMesh(plain_mesh, 1, 1), SurfaceIndex(anchored_mesh)) / voxel_m;
  const double back =
      MeanDistance_m(SampleMesh(anchored_mesh, 1, 1), SurfaceIndex(plain_mesh)) / voxel_m;
  std::printf("scene meshes: %.4f and %.4f voxels apart\n", there, back);
  EXPECT_LE(there, kMeanDistance_voxels);
  EXPECT_LE(back, kMeanDistance_voxels);
}

}  // namespace
}  // namespace tsdfpp
