// docs/map.md, "`tsdf`: one field", in floating point; and the field that moves nothing.
#include <algorithm>

#include "tests/reference/dense_map.h"
#include "tests/reference/float_map.h"
#include "tests/reference/float_mesh.h"
#include "tests/reference/float_move.h"

namespace tsdfpp::reference {
namespace {

struct FieldVoxel : FloatVoxel {
  InstanceId label = kNoInstance;
  int confidence = 0;
};
using Field = SparseVoxels<FieldVoxel>;

class FloatTsdf : public FloatMap {
 public:
  FloatTsdf(const FloatConfig& config, FieldMoves moves) : rule_(config), moves_(moves) {}

  std::unique_ptr<FloatMap> Clone() const override { return std::make_unique<FloatTsdf>(*this); }

  void SetObjectPose(InstanceId id, const Pose& T_WO) override {
    if (moves_ == FieldMoves::kNone) return;
    if (const auto T_rel = poses_.Update(id, T_WO)) Move(id, *T_rel);
  }

  void Fuse(const Frame& frame, const cv::Mat& labels) override {
    BlockSet seen_blocks;
    Allocate(
        frame, labels, Pose::Identity(), rule_.map(), [](InstanceId) { return true; }, seen_blocks);
    for (const auto& zyx : seen_blocks.blocks()) field_.FindOrAdd(zyx);
    const View view(frame, labels, Pose::Identity(), rule_.map());
    field_.ForEach([&](const Eigen::Vector3i& v, FieldVoxel& voxel) {
      const std::optional<Seen> seen = view.Look(v);
      if (!seen) return;
      rule_.Fuse(*seen, rule_.WeightOf(*seen, frame.intrinsics), voxel);
      if (rule_.InBand(seen->s)) Vote(seen->label, voxel);
    });
    FreeEmptyBlocks();
  }

  void Remove(InstanceId id) override {
    Vacate(id);
    poses_.Forget(id);
    FreeEmptyBlocks();
  }

  TriangleMesh SceneMesh() const override {
    const float h = rule_.voxel();
    TriangleMesh mesh = MeshOf(field_, h);
    mesh.face_ids.reserve(mesh.triangles.size());
    for (const auto& [a, b, c] : mesh.triangles) {
      const Eigen::Vector3f sum = mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c];
      const InstanceId label = field_(NearestVoxel(sum / 3, h)).label;
      mesh.face_ids.push_back(label == kNoInstance ? kBackground : label);
    }
    return mesh;
  }

  std::optional<FloatVoxel> ValueAt(InstanceId id, const Eigen::Vector3i& v) const override {
    const FieldVoxel& voxel = field_(v);
    if (!IsSource(id, voxel)) return std::nullopt;
    return voxel;
  }

  std::vector<Listing> ListAt(const Eigen::Vector3i& v) const override {
    const FieldVoxel& voxel = field_(v);
    if (voxel.label == kNoInstance) return {};
    return {{voxel.label, voxel.confidence}};
  }

  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override {
    return VoxelsWith(field_, [id](const FieldVoxel& voxel) { return IsSource(id, voxel); });
  }

  std::vector<Eigen::Vector3i> ListedVoxels() const override {
    return VoxelsWith(field_, [](const FieldVoxel& voxel) { return voxel.label != kNoInstance; });
  }

  void ForEachObserved(const std::function<void(const FloatVoxel&)>& function) const override {
    field_.ForEach([&](const Eigen::Vector3i&, const FieldVoxel& voxel) {
      if (voxel.observed()) function(voxel);
    });
  }

 private:
  static bool IsSource(InstanceId id, const FieldVoxel& voxel) {
    return voxel.label == id && voxel.observed();
  }

  void Vote(InstanceId m, FieldVoxel& voxel) const {
    if (voxel.label == kNoInstance) {
      voxel.label = m;
      voxel.confidence = 1;
    } else if (voxel.label == m) {
      voxel.confidence = std::min(voxel.confidence + 1, rule_.map().confidence_cap);
    } else if (--voxel.confidence <= 0) {
      voxel.label = m;
      voxel.confidence = 1;
    }
  }

  bool Moves(const FieldVoxel& voxel) const {
    return moves_ != FieldMoves::kNear || voxel.distance <= rule_.voxel();
  }

  void Vacate(InstanceId id) {
    field_.ForEach([&](const Eigen::Vector3i&, FieldVoxel& voxel) {
      if (IsSource(id, voxel) && Moves(voxel)) voxel = FieldVoxel{};
    });
  }

  void Move(InstanceId id, const Pose& T_rel) {
    const std::vector<Eigen::Vector3i> voxels = ObservedVoxels(id);
    if (voxels.empty()) return;
    const DenseGrid<FieldVoxel> sources = CopyOf(field_, voxels);
    Vacate(id);
    const Pose T_rel_inverse = T_rel.inverse();
    const Box reached = MovedBox(sources.box(), T_rel, rule_.map().voxel_m);
    ForEachVoxel(reached, [&](const Eigen::Vector3i& v) {
      const Neighbourhood place(SourcePoint(T_rel_inverse, v, rule_.map().voxel_m));
      std::array<FloatVoxel, 8> corners;
      for (int i = 0; i < 8; ++i) {
        corners[static_cast<std::size_t>(i)] = sources(CubeCorner(place.base, i));
      }
      const std::optional<FloatVoxel> value = rule_.Interpolate(place, corners);
      if (!value) return;
      FieldVoxel written;
      static_cast<FloatVoxel&>(written) = *value;
      if (!Moves(written)) return;
      written.label = id;
      written.confidence = sources(CubeCorner(place.base, NearestCorner(place))).confidence;
      field_.At(v) = written;
    });
    FreeEmptyBlocks();
  }

  void FreeEmptyBlocks() {
    field_.DropUnless([](const FieldVoxel& voxel) { return voxel.observed(); });
  }

  FloatRule rule_;
  FieldMoves moves_;
  Field field_;
  PoseBook poses_;
};

}  // namespace

std::unique_ptr<FloatMap> MakeFloatTsdf(const FloatConfig& config, FieldMoves moves) {
  return std::make_unique<FloatTsdf>(config, moves);
}

}  // namespace tsdfpp::reference
