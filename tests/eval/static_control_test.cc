// The negative control: where nothing moves, all maps have to agree, Open3D's among them. What the
// experiment then finds between them comes from motion.
//
// Every fourth frame of scenes/static.toml is mapped (30 of 120), for time.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "eval/adapters/open3d_peer.h"
#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "metrics/preservation.h"
#include "metrics/truth_surface.h"
#include "metrics/visibility.h"
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

// Where samples are compared: the room is twenty times the table and would drown it.
struct Part {
  const char* name;
  Eigen::AlignedBox3f box_W;
};

// Everything, and the table's top with all that stands on it.
std::vector<Part> Parts(const FrameSet& set) {
  const float far_m = 100;
  const TrueModel& background = set.models.front();
  Eigen::AlignedBox3f table;
  for (std::size_t i = 0; i < background.mesh_O.triangles.size(); ++i) {
    if (background.regions[background.face_region[i]] != "table") continue;
    for (const std::uint32_t corner : background.mesh_O.triangles[i]) {
      table.extend(background.mesh_O.vertices[corner]);
    }
  }
  table.min().z() = table.max().z() - 0.1F;
  table.max().z() += 0.5F;  // higher than any toy
  return {{"everything",
           {Eigen::Vector3f::Constant(-far_m).eval(), Eigen::Vector3f::Constant(far_m).eval()}},
          {"table and toys", table}};
}

// One map's surface: an index, and the samples of it that were seen.
struct Candidate {
  Candidate(std::string title, TriangleMesh mesh, const FrameSet& set, double margin_m)
      : name(std::move(title)), seen(SeenSamples(mesh, set.frames, margin_m)), index(mesh) {}
  std::string name;
  SampleSet seen;
  SurfaceIndex index;
};

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

  // Of each part of the scene.
  std::vector<double> FScores(const SampleSet& seen_W, const SurfaceIndex& surface_W,
                              const std::vector<Part>& parts) const {
    const std::vector<double> precision = Precision(seen_W, parts);
    const std::vector<double> recall = Recall(surface_W, parts);
    std::vector<double> f_scores;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      std::printf("%s: precision %.4f, recall %.4f\n", parts[p].name, precision[p], recall[p]);
      f_scores.push_back(2 * precision[p] * recall[p] / (precision[p] + recall[p]));
    }
    return f_scores;
  }

 private:
  std::vector<double> Precision(const SampleSet& seen_W, const std::vector<Part>& parts) const {
    std::vector<PlacedTruth> placed;
    for (std::size_t i = 0; i < surfaces_.size(); ++i) {
      placed.push_back({surfaces_[i].get(), T_WO_[i]});
    }
    std::vector<float> good = FindNearestTruth(seen_W.points, placed).distance_m;
    for (float& value : good) value = value <= voxel_m_ ? 1.0F : 0.0F;
    std::vector<double> precision;
    for (const Part& part : parts) precision.push_back(MeanIn(part.box_W, seen_W.points, good));
    return precision;
  }

  std::vector<double> Recall(const SurfaceIndex& surface_W, const std::vector<Part>& parts) const {
    std::vector<double> seen_m2(parts.size(), 0);
    std::vector<double> good_m2(parts.size(), 0);
    for (std::size_t i = 0; i < trackers_.size(); ++i) {
      const SampleSet& samples = trackers_[i].samples_O();
      const std::vector<Eigen::Vector3f> points_W = TransformPoints(T_WO_[i], samples.points);
      const Selection seen = SelectSeen(trackers_[i], SelectAll(samples));
      const Selection good =
          Reconstructed(MatchSamples(samples, seen, T_WO_[i], surface_W, voxel_m_), voxel_m_);
      for (std::size_t k = 0; k < seen.size(); ++k) {
        if (seen[k] == 0) continue;
        for (std::size_t p = 0; p < parts.size(); ++p) {
          if (!parts[p].box_W.contains(points_W[k])) continue;
          seen_m2[p] += samples.area_m2[k];
          good_m2[p] += good[k] != 0 ? samples.area_m2[k] : 0;
        }
      }
    }
    for (std::size_t p = 0; p < parts.size(); ++p) good_m2[p] /= seen_m2[p];
    return good_m2;
  }

  double voxel_m_;
  std::vector<SeenTracker> trackers_;
  std::vector<Pose> T_WO_;
  std::vector<std::unique_ptr<TruthSurface>> surfaces_;
};

void ExpectNearEachOther(const std::vector<Candidate>& candidates, const std::vector<Part>& parts,
                         double voxel_m) {
  for (const Candidate& a : candidates) {
    for (const Candidate& b : candidates) {
      if (&a == &b) continue;
      const std::vector<float> distances_m = b.index.Nearest(a.seen.points).distance_m;
      for (const Part& part : parts) {
        const double voxels = MeanIn(part.box_W, a.seen.points, distances_m) / voxel_m;
        std::printf("%s: %s to %s %.4f voxels\n", part.name, a.name.c_str(), b.name.c_str(),
                    voxels);
        EXPECT_LE(voxels, kMeanDistance_voxels) << part.name << ": " << a.name << " to " << b.name;
      }
    }
  }
}

void ExpectEqualFScores(const std::vector<Candidate>& candidates, const std::vector<Part>& parts,
                        const TruthScore& truth) {
  std::vector<std::vector<double>> f_scores;
  for (const Candidate& candidate : candidates) {
    std::printf("%s against the truth\n", candidate.name.c_str());
    f_scores.push_back(truth.FScores(candidate.seen, candidate.index, parts));
  }
  for (std::size_t p = 0; p < parts.size(); ++p) {
    double least = 1;
    double greatest = 0;
    for (const std::vector<double>& scores : f_scores) {
      least = std::min(least, scores[p]);
      greatest = std::max(greatest, scores[p]);
    }
    std::printf("%s: F-scores from %.4f to %.4f\n", parts[p].name, least, greatest);
    EXPECT_LT(greatest - least, kFScoreDifference) << parts[p].name;
    EXPECT_GT(least, 0.9) << parts[p].name << ": maps that agree on a wrong surface prove nothing";
  }
}

TEST(StaticControl, AllMapsAndOpen3dAgree) {
  const auto set = ReadFrames("static", kStep);
  ASSERT_TRUE(set.has_value()) << set.error().message;
  const MapConfig config = PaperConfig(0);
  // A sheet within the band of what was measured counts as seen: wide enough to hold every fault
  // that a truncated field can have in front of a camera.
  const double margin_m = config.front();

  std::vector<Candidate> candidates;
  for (const Method method : {Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored}) {
    candidates.emplace_back(std::string(MethodName(method)), MapOf(method, 0, *set)->SceneMesh(),
                            *set, margin_m);
  }
  SetOpen3dThreads(1);
  Open3dVolume open3d(config.voxel_m, config.front(), Open3dColour::kNone);
  for (const Frame& frame : set->frames) open3d.Integrate(frame);
  candidates.emplace_back("Open3D, the same band", open3d.Triangles(), *set, margin_m);

  const TruthScore truth(*set, config.voxel_m);
  const std::vector<Part> parts = Parts(*set);
  ExpectNearEachOther(candidates, parts, config.voxel_m);
  ExpectEqualFScores(candidates, parts, truth);
}

// Voxels and mesh of one object.
std::string ObjectBytes(const MapRepresentation& map, InstanceId id) {
  std::string bytes;
  for (const Eigen::Vector3i& v : VoxelsOf(map).ObservedVoxels(id)) {
    const auto value = VoxelsOf(map).ValueAt(id, v);
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
  const auto listed = VoxelsOf(*plain).ListedVoxels();
  ASSERT_EQ(listed.size(), VoxelsOf(*anchored).ListedVoxels().size());
  const auto ids_at = [](const MapRepresentation& map, const Eigen::Vector3i& v) {
    std::vector<InstanceId> ids;
    for (const Listing& entry : VoxelsOf(map).ListAt(v)) ids.push_back(entry.id);
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
  const Eigen::AlignedBox3f table = Parts(*set).back().box_W;
  const auto distance_voxels = [&](const TriangleMesh& from, const TriangleMesh& to) {
    const std::vector<Eigen::Vector3f> points = SampleMesh(from, 1, 1).points;
    return MeanIn(table, points, SurfaceIndex(to).Nearest(points).distance_m) / voxel_m;
  };
  const double there = distance_voxels(plain_mesh, anchored_mesh);
  const double back = distance_voxels(anchored_mesh, plain_mesh);
  std::printf("scene meshes on the table: %.4f and %.4f voxels apart\n", there, back);
  EXPECT_LE(there, kMeanDistance_voxels);
  EXPECT_LE(back, kMeanDistance_voxels);
}

}  // namespace
}  // namespace tsdfpp
