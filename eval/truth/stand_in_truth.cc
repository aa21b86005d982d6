#include "eval/truth/stand_in_truth.h"

#include <algorithm>

#include "core/folders.h"
#include "mapper/pipeline.h"
#include "sequence/cofusion_layout.h"

namespace tsdfpp {
namespace {

// The most that a voxel counts: up to so many frames, every observation counts the same.
constexpr int kWeightCap = 255;

bool HasTrajectory(const ObjectInfo& object) {
  return object.id != kBackground && !object.semantic_class.empty();
}

// An object by itself: in its own frame it stands still, as a background does.
struct Alone {
  ObjectInfo info;
  std::unique_ptr<Pipeline> pipeline;
};

// What the frame shows of one object, from a camera that is placed in the object's frame.
std::optional<Frame> OnlyOf(const Frame& frame, const ObjectInfo& object) {
  Pose T_WO = Pose::Identity();
  if (const auto pose = frame.T_WO.find(object.id); pose != frame.T_WO.end()) {
    T_WO = pose->second;
  } else if (HasTrajectory(object)) {
    return std::nullopt;
  }
  const cv::Mat here = frame.mask == object.id;
  if (cv::countNonZero(here) == 0) return std::nullopt;
  Frame only = frame;
  only.T_WO.clear();
  only.T_WC = T_WO.inverse() * frame.T_WC;
  // New images: zeros would be written into those that are shared with `frame`.
  only.depth = cv::Mat(frame.depth.size(), frame.depth.type(), cv::Scalar(0));
  frame.depth.copyTo(only.depth, here);
  only.mask = cv::Mat(frame.mask.size(), frame.mask.type(), cv::Scalar(0));
  return only;
}

class PlannedSource : public FrameSource {
 public:
  PlannedSource(std::unique_ptr<FrameSource> source, const RevealPlan& plan,
                std::vector<TrueModel> models)
      : source_(std::move(source)), info_(source_->info()), models_(std::move(models)) {
    info_.reveal = plan;
  }
  const SequenceInfo& info() const override { return info_; }
  Expected<Frame> Read(int index) override { return source_->Read(index); }
  bool IsSensed() const override { return source_->IsSensed(); }
  Expected<Frame> ReadTrue(int index) override { return source_->ReadTrue(index); }
  bool HasTruth() const override { return !models_.empty() || source_->HasTruth(); }
  Expected<std::vector<TrueModel>> Truth() override {
    if (models_.empty()) return source_->Truth();
    return models_;
  }

 private:
  std::unique_ptr<FrameSource> source_;
  SequenceInfo info_;
  std::vector<TrueModel> models_;
};

}  // namespace

RevealPlan PaperPlan(const SequenceInfo& info) {
  RevealPlan plan;
  const int last = info.first_index + info.frame_count - 1;
  plan.frame = std::clamp(kPaperReveal, info.first_index, last);
  for (const ObjectInfo& object : info.objects) {
    if (HasTrajectory(object)) plan.removed.push_back(object.id);
  }
  return plan;
}

bool IsForeignCofusion(const std::filesystem::path& path) {
  std::error_code ignored;
  return cofusion::IsCofusion(path) && !IsThere(path / cofusion::kSequence) &&
         !IsThere(path / cofusion::kModels);
}

Expected<std::vector<TrueModel>> ReconstructTruth(
    FrameSource& source, double voxel_m, const std::function<void(int done, int total)>& progress) {
  const SequenceInfo& info = source.info();
  PipelineConfig config;
  config.method = Method::kTsdf;
  config.map.voxel_m = voxel_m;
  config.map.weight_cap = kWeightCap;
  TSDFPP_RETURN_IF_ERROR(config.map.SetProfile("close"));
  TSDFPP_RETURN_IF_ERROR(config.map.Validate());
  std::vector<Alone> objects;
  for (const ObjectInfo& object : info.objects) {
    const std::vector<ObjectInfo> itself{{kBackground, object.name, ""}};
    objects.push_back({object, std::make_unique<Pipeline>(config, itself)});
  }
  for (int i = 0; i < info.frame_count; ++i) {
    const int index = info.first_index + i;
    TSDFPP_ASSIGN(const Frame frame,
                  source.IsSensed() ? source.ReadTrue(index) : source.Read(index));
    if (frame.mask.empty()) return DataError("{}: frame {} has no mask", info.name, index);
    for (Alone& object : objects) {
      if (const auto only = OnlyOf(frame, object.info)) {
        const auto step = object.pipeline->Process(*only);
        if (!step)
          return DataError("{}: {}: {}", info.name, object.info.name, step.error().message);
      }
    }
    if (progress) progress(i + 1, info.frame_count);
  }
  std::vector<TrueModel> models;
  for (const Alone& object : objects) {
    TrueModel model;
    model.info = object.info;
    model.mesh_O = object.pipeline->map().ObjectMesh(kBackground);
    if (model.mesh_O.triangles.empty()) continue;
    model.mesh_O.face_ids.clear();
    model.regions = {object.info.name};
    model.face_region.assign(model.mesh_O.triangles.size(), 0);
    models.push_back(std::move(model));
  }
  if (models.empty() || models.front().info.id != kBackground) {
    return DataError("{}: its frames show no background to be compared with", info.name);
  }
  return models;
}

TruthOptions StandInOptions(double voxel_m) {
  TruthOptions options;
  // No region of the background is known to matter more.
  options.sampling.coarse_per_cm2 = 1;
  options.visibility.margin_m = std::max(options.visibility.margin_m, voxel_m);
  options.closed = false;
  return options;
}

std::string StandInNote(const SequenceInfo& info, double voxel_m) {
  return fmt::format(
      "{} has no true surfaces: scores are against a reconstruction of all its {} frames (voxels "
      "of "
      "{:g} mm, each object by itself at its given poses). They say what a map keeps of what was "
      "seen, not how true that is, and 'table' stands for all of the background.",
      info.name, info.frame_count, 1e3 * voxel_m);
}

std::unique_ptr<FrameSource> WithPlan(std::unique_ptr<FrameSource> source, const RevealPlan& plan,
                                      std::vector<TrueModel> models) {
  return std::make_unique<PlannedSource>(std::move(source), plan, std::move(models));
}

}  // namespace tsdfpp
