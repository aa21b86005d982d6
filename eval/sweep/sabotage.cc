#include "eval/sweep/sabotage.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace tsdfpp {
namespace {

struct Named {
  Sabotage sabotage;
  std::string_view name;
  std::string_view words;
};
constexpr Named kNamed[] = {
    {Sabotage::kNone, "none", "nothing is broken"},
    {Sabotage::kObjectPose, "object-pose",
     "poses of the moving objects are 5 mm off from one third of the sequence on"},
    {Sabotage::kMasksSwapped, "masks-swapped", "two objects have each other's mask"},
    {Sabotage::kMaskDilated, "mask-dilated",
     "the mask of one moving object is a pixel larger all around"},
    {Sabotage::kPrincipalPoint, "principal-point", "the principal point is off by one pixel"},
    {Sabotage::kTruncationHalved, "truncation-halved", "the truncation is half as wide"},
    {Sabotage::kFrozenObject, "frozen-object", "objects keep the pose of the first frame"},
    {Sabotage::kObjectLate, "object-late",
     "poses of the moving objects are one recorded frame late"},
    {Sabotage::kInactiveDropped, "inactive-dropped", "a removal uncovers nothing"},
    {Sabotage::kDepthScale, "depth-scale", "depth is multiplied by 1.005"},
    {Sabotage::kTruthShifted, "truth-shifted", "the true surfaces are one voxel too high"},
    {Sabotage::kNearestResampling, "nearest-resampling",
     "values move to the nearest voxel and are not interpolated"},
    {Sabotage::kRimsOff, "rims-off", "cubes at a mask's outline are not completed"},
    {Sabotage::kStalePose, "stale-pose", "the middle frame has the poses of the frame before"},
    {Sabotage::kContradictionOff, "contradiction-off",
     "pixels of other objects do not clear what an object wrongly claims"},
    {Sabotage::kLabelsPermuted, "labels-permuted", "the labels of the meshes are permuted"},
    {Sabotage::kVisibleOnly, "visible-only", "only visible surface is sampled for the scores"}};

const Named& Find(Sabotage sabotage) {
  for (const Named& named : kNamed) {
    if (named.sabotage == sabotage) return named;
  }
  std::abort();
}

// The objects whose removal the experiment is about, all where it names none.
bool IsMover(const SequenceInfo& info, InstanceId id) {
  if (id == kBackground) return false;
  if (!info.reveal || info.reveal->removed.empty()) return true;
  return std::find(info.reveal->removed.begin(), info.reveal->removed.end(), id) !=
         info.reveal->removed.end();
}

// A mover and another object; the least ids. kNoInstance where there are not two.
std::pair<InstanceId, InstanceId> TwoObjects(const SequenceInfo& info) {
  std::pair<InstanceId, InstanceId> two{kNoInstance, kNoInstance};
  for (const ObjectInfo& object : info.objects) {
    if (two.first == kNoInstance && IsMover(info, object.id)) two.first = object.id;
  }
  for (const ObjectInfo& object : info.objects) {
    if (object.id == kBackground || object.id == two.first) continue;
    if (two.second == kNoInstance) two.second = object.id;
  }
  return two;
}

cv::Mat Swapped(const cv::Mat& mask, InstanceId a, InstanceId b) {
  cv::Mat swapped = mask.clone();
  for (int v = 0; v < swapped.rows; ++v) {
    for (int u = 0; u < swapped.cols; ++u) {
      auto& id = swapped.at<std::uint16_t>(v, u);
      if (id == a) {
        id = b;
      } else if (id == b) {
        id = a;
      }
    }
  }
  return swapped;
}

// The object's mask and the pixels beside it, corners too.
cv::Mat Dilated(const cv::Mat& mask, InstanceId id) {
  cv::Mat larger;
  cv::dilate(mask == id, larger, cv::Mat());
  cv::Mat dilated = mask.clone();
  dilated.setTo(cv::Scalar(id), larger);
  return dilated;
}

// These objects' ids in a circle; the background keeps its own.
void Permute(const std::set<InstanceId>& ids, TriangleMesh& mesh) {
  for (InstanceId& id : mesh.face_ids) {
    if (id == kBackground) continue;
    const auto next = ids.upper_bound(id);
    if (!ids.empty()) id = next == ids.end() ? *ids.begin() : *next;
  }
}

TriangleMesh WithoutFaces(const TriangleMesh& mesh, const std::set<InstanceId>& removed) {
  TriangleMesh kept = mesh;
  kept.triangles.clear();
  kept.face_ids.clear();
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (removed.contains(mesh.face_ids[i])) continue;
    kept.triangles.push_back(mesh.triangles[i]);
    kept.face_ids.push_back(mesh.face_ids[i]);
  }
  return kept;
}

// A source with other true surfaces.
class RaisedTruth final : public FrameSource {
 public:
  RaisedTruth(FrameSource& source, float by_m) : source_(source), by_m_(by_m) {}

  const SequenceInfo& info() const override { return source_.info(); }
  Expected<Frame> Read(int index) override { return source_.Read(index); }
  bool HasTruth() const override { return source_.HasTruth(); }
  Expected<std::vector<TrueModel>> Truth() override {
    TSDFPP_ASSIGN(std::vector<TrueModel> models, source_.Truth());
    for (TrueModel& model : models) {
      for (Eigen::Vector3f& vertex : model.mesh_O.vertices) vertex.z() += by_m_;
    }
    return models;
  }

 private:
  FrameSource& source_;
  float by_m_;
};

}  // namespace

const std::vector<Sabotage>& Sabotages() {
  static const std::vector<Sabotage> all = [] {
    std::vector<Sabotage> sabotages;
    for (const Named& named : kNamed) {
      if (named.sabotage != Sabotage::kNone) sabotages.push_back(named.sabotage);
    }
    return sabotages;
  }();
  return all;
}

std::string_view SabotageName(Sabotage sabotage) { return Find(sabotage).name; }
std::string_view SabotageWords(Sabotage sabotage) { return Find(sabotage).words; }

Expected<Sabotage> SabotageFromName(std::string_view name) {
  std::string known;
  for (const Named& named : kNamed) {
    if (named.name == name) return named.sabotage;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", named.name);
  }
  return UsageError("is '{}', expected one of {}", name, known);
}

bool IsOfSequence(Sabotage sabotage) {
  switch (sabotage) {
    case Sabotage::kObjectPose:
    case Sabotage::kFrozenObject:
    case Sabotage::kObjectLate:
    case Sabotage::kStalePose:
    case Sabotage::kMasksSwapped:
    case Sabotage::kMaskDilated:
    case Sabotage::kPrincipalPoint:
    case Sabotage::kDepthScale:
    case Sabotage::kTruthShifted:
      return true;
    default:
      return false;
  }
}

bool IsOfScoring(Sabotage sabotage) {
  return sabotage == Sabotage::kInactiveDropped || sabotage == Sabotage::kLabelsPermuted ||
         sabotage == Sabotage::kVisibleOnly;
}

Expected<void> FrameSabotage::Prepare(FrameSource& source, int index) {
  if (sabotage_ == Sabotage::kFrozenObject && first_T_WO_.empty()) {
    TSDFPP_ASSIGN(const Frame first, source.Read(frames_.front()));
    first_T_WO_ = {first.T_WO.begin(), first.T_WO.end()};
  }
  if (sabotage_ == Sabotage::kObjectLate && index > source.info().first_index) {
    TSDFPP_ASSIGN(const Frame before, source.Read(index - 1));
    late_T_WO_ = {before.T_WO.begin(), before.T_WO.end()};
  }
  const std::size_t middle = frames_.size() / 2;
  if (sabotage_ == Sabotage::kStalePose && middle > 0 && index == frames_[middle] && !stale_) {
    TSDFPP_ASSIGN(stale_, source.Read(frames_[middle - 1]));
  }
  if (sabotage_ == Sabotage::kMasksSwapped && TwoObjects(source.info()).second == kNoInstance) {
    return UsageError("sabotage {}: scene '{}' has fewer than two objects", SabotageName(sabotage_),
                      source.info().name);
  }
  return {};
}

void FrameSabotage::Apply(const SequenceInfo& info, Frame& frame) const {
  switch (sabotage_) {
    case Sabotage::kObjectPose:
      if (frame.index < frames_[frames_.size() / 3]) return;
      for (auto& [id, T_WO] : frame.T_WO) {
        if (IsMover(info, id)) T_WO.translation().x() += kObjectPoseShift_m;
      }
      return;
    case Sabotage::kFrozenObject:
      for (auto& [id, T_WO] : frame.T_WO) {
        if (const auto first = first_T_WO_.find(id); first != first_T_WO_.end()) {
          T_WO = first->second;
        }
      }
      return;
    case Sabotage::kObjectLate:
      for (auto& [id, T_WO] : frame.T_WO) {
        const auto late = late_T_WO_.find(id);
        if (IsMover(info, id) && late != late_T_WO_.end()) T_WO = late->second;
      }
      return;
    case Sabotage::kStalePose:
      if (!stale_ || frame.index != frames_[frames_.size() / 2]) return;
      frame.T_WC = stale_->T_WC;
      frame.T_WO = stale_->T_WO;
      return;
    case Sabotage::kMasksSwapped: {
      const auto [a, b] = TwoObjects(info);
      frame.mask = Swapped(frame.mask, a, b);
      return;
    }
    case Sabotage::kMaskDilated:
      frame.mask = Dilated(frame.mask, TwoObjects(info).first);
      return;
    case Sabotage::kPrincipalPoint:
      frame.intrinsics.cx += 1;
      return;
    case Sabotage::kDepthScale: {
      cv::Mat scaled;  // the truth may share the image
      frame.depth.convertTo(scaled, -1, kDepthScaleFactor);
      frame.depth = scaled;
      return;
    }
    default:
      return;
  }
}

void SabotageMap(Sabotage sabotage, PipelineConfig& config) {
  if (sabotage == Sabotage::kTruncationHalved) {
    config.map.trunc_front_voxels /= 2;
    config.map.trunc_back_voxels /= 2;
  } else if (sabotage == Sabotage::kContradictionOff) {
    config.map.contradiction = false;
  } else if (sabotage == Sabotage::kNearestResampling) {
    config.map.resampling = Resampling::kNearest;
  } else if (sabotage == Sabotage::kRimsOff) {
    config.map.rims = false;
  }
}

void SabotageMeshes(Sabotage sabotage, SceneMeshes& meshes) {
  if (!meshes.labelled) return;
  if (sabotage == Sabotage::kInactiveDropped) {
    for (auto& [removed, mesh] : meshes.without) mesh = WithoutFaces(meshes.scene, removed);
  } else if (sabotage == Sabotage::kLabelsPermuted) {
    std::set<InstanceId> ids(meshes.scene.face_ids.begin(), meshes.scene.face_ids.end());
    ids.erase(kBackground);
    Permute(ids, meshes.scene);
    for (auto& [removed, mesh] : meshes.without) Permute(ids, mesh);
  }
}

Expected<SceneTruth> SabotagedTruth(Sabotage sabotage, FrameSource& source, double voxel_m) {
  if (sabotage != Sabotage::kTruthShifted) return SceneTruth::Create(source);
  RaisedTruth raised(source, static_cast<float>(voxel_m));
  return SceneTruth::Create(raised);
}

Expected<SceneTruth> TruthOfRecentFrames(FrameSource& source, const std::deque<Frame>& recent) {
  TSDFPP_ASSIGN(SceneTruth truth, SceneTruth::Create(source));
  for (const Frame& frame : recent) TSDFPP_RETURN_IF_ERROR(truth.Observe(frame));
  return truth;
}

}  // namespace tsdfpp
