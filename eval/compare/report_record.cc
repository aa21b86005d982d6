#include "eval/compare/report_record.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/files.h"
#include "core/json_text.h"
#include "eval/compare/record_meshes.h"
#include "eval/picture/draw_scene.h"
#include "eval/picture/record_images.h"
#include "metrics/mesh_tools.h"
#include "metrics/trajectory.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kKeyFrames = 10;
constexpr std::size_t kTrianglesAKeyFrame = 25000;
constexpr double kFarShare = 0.2;  // of them for what is far from the table
constexpr std::size_t kMoverTriangles = 4000;
constexpr std::size_t kLayerTriangles = 6000;
constexpr std::size_t kTruthTriangles = 8000;  // an object
constexpr double kImageWidth = 480;
constexpr double kPictureWidth = 640;
constexpr int kDepthStride = 4;  // pixels between those that the depth images' range is taken from

nlohmann::json PoseJson(const Pose& T) {
  const Eigen::Quaterniond q(T.rotation());
  const auto rounded = [](double x) { return std::round(x * 1e5) / 1e5; };
  nlohmann::json numbers = nlohmann::json::array();
  for (int axis = 0; axis < 3; ++axis) numbers.push_back(rounded(T.translation()[axis]));
  for (const double x : {q.x(), q.y(), q.z(), q.w()}) numbers.push_back(rounded(x));
  return numbers;
}

nlohmann::json GridJson(const PositionGrid& grid) {
  return {{"origin_m", {grid.origin.x(), grid.origin.y(), grid.origin.z()}},
          {"step_m", grid.step_m}};
}

// To so many parts of one: the text is short, which a step's multiple in binary is not.
double Rounded(double value, double parts) { return std::round(value * parts) / parts; }

nlohmann::json Milliseconds(const std::vector<double>& seconds) {
  nlohmann::json list = nlohmann::json::array();
  for (const double s : seconds) list.push_back(Rounded(1e3 * s, 1000));
  return list;
}

nlohmann::json IntrinsicsJson(const Intrinsics& k) {
  return {{"width", k.width}, {"height", k.height}, {"fx", k.fx},
          {"fy", k.fy},       {"cx", k.cx},         {"cy", k.cy}};
}

std::vector<InstanceId> IdsOf(const TriangleMesh& mesh) {
  std::vector<InstanceId> ids = mesh.face_ids;
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

}  // namespace

std::string StillName(const std::string& what, int frame) {
  return fmt::format("{}-{:06}.webp", what, frame);
}

std::vector<int> ChooseKeyFrames(const std::vector<int>& evaluated, std::optional<int> examined,
                                 std::size_t most) {
  std::vector<int> chosen;
  const std::size_t count = std::min(most, evaluated.size());
  for (std::size_t i = 0; i < count; ++i) {
    chosen.push_back(evaluated[(i + 1) * evaluated.size() / count - 1]);
  }
  if (!examined || chosen.empty() ||
      std::find(evaluated.begin(), evaluated.end(), *examined) == evaluated.end()) {
    return chosen;
  }
  // The nearest key frame gives way, the last one only where there is no other.
  const auto last = chosen.size() > 1 ? chosen.end() - 1 : chosen.end();
  if (*examined == chosen.back()) return chosen;
  *std::min_element(chosen.begin(), last, [&](int a, int b) {
    return std::abs(a - *examined) < std::abs(b - *examined);
  }) = *examined;
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

ReportRecorder::ReportRecorder(const CompareResult& result, std::filesystem::path out)
    : result_(result), out_(std::move(out)), runs_(result.runs.size()) {
  std::vector<int> evaluated;
  for (int index = result.info.first_index; index <= result.last_frame; ++index) {
    if (IsEvaluated(result, index)) evaluated.push_back(index);
  }
  key_frames_ = ChooseKeyFrames(evaluated, result.reveal_frame, kKeyFrames);
  grid_ = GridAround(BoundsOf(result.truth->surface(0).model().mesh_O));
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    runs_[r] = {{"folder", result.runs[r]->FolderName()},
                {"key_frames", nlohmann::json::array()},
                {"memory_mb", nlohmann::json::array()},
                {"position_error_mm", nlohmann::json::object()}};
  }
}

nlohmann::json ReportRecorder::Add(const std::string& bytes) {
  nlohmann::json place = nlohmann::json::array({bytes_.size(), bytes.size()});
  bytes_ += bytes;
  return place;
}

std::string ReportRecorder::Encoded(const cv::Mat& rgb, bool lossless) {
  auto bytes = WebpBytes(rgb, lossless);
  if (bytes) return std::move(*bytes);
  failure_ = bytes.error();
  return "";
}

nlohmann::json ReportRecorder::AddImage(const cv::Mat& rgb, bool lossless) {
  return Add(Encoded(rgb, lossless));
}

Expected<void> ReportRecorder::WriteStill(const std::string& name, int frame,
                                          const std::string& bytes) const {
  return WriteFile(out_ / "record" / "stills" / StillName(name, frame), bytes);
}

nlohmann::json ReportRecorder::AddMesh(const TriangleMesh& mesh, const VertexMeasures& measures) {
  // The recording's grid is fixed before anything is mapped, around the first true surface.
  const Eigen::AlignedBox3f box = BoundsOf(mesh);
  const bool is_inside = Holds(grid_, box);
  const PositionGrid grid = is_inside ? grid_ : GridAround(box);
  const PackedMesh packed = Pack(mesh, measures, grid);
  nlohmann::json chunk{{"vertices", packed.vertices},
                       {"triangles", packed.triangles},
                       {"vertex_bytes", Add(packed.vertex_bytes)},
                       {"index_bytes", Add(packed.index_bytes)}};
  if (!is_inside) chunk["grid"] = GridJson(grid);
  return chunk;
}

void ReportRecorder::AddChunks(const TriangleMesh& mesh, const char* layer, std::size_t triangles,
                               nlohmann::json& chunks) {
  const double slack_m = 3 * result_.config.map.voxel_m;
  const int frames = result_.last_frame - result_.info.first_index + 1;
  const auto add = [&](const TriangleMesh& part, InstanceId id, std::size_t most) {
    if (part.triangles.empty()) return;
    const TriangleMesh small = Decimate(part, most);
    nlohmann::json chunk =
        AddMesh(small, sights_.Measure(small, id, *result_.truth, slack_m, frames));
    chunk["id"] = id;
    chunk["layer"] = layer;
    chunks.push_back(std::move(chunk));
  };
  const std::vector<InstanceId> ids = IdsOf(mesh);
  // Objects first: they are small, and what they leave is the room's.
  for (auto id = ids.rbegin(); id != ids.rend(); ++id) {
    const TriangleMesh faces = FacesOf(mesh, *id);
    if (*id != kBackground) {
      add(faces, *id, std::max<std::size_t>(faces.triangles.size() / 2, 2000));
      triangles -= std::min(triangles, chunks.back()["triangles"].get<std::size_t>());
      continue;
    }
    const Eigen::AlignedBox3f table = TableBox(*result_.truth);
    if (table.isEmpty()) {
      add(faces, *id, triangles);
      continue;
    }
    const auto [near, far] = SplitByBox(faces, table);
    const auto for_far = static_cast<std::size_t>(kFarShare * static_cast<double>(triangles));
    add(far, *id, for_far);
    // Its locked borders can have kept more.
    const std::size_t of_far =
        far.triangles.empty() ? 0 : chunks.back()["triangles"].get<std::size_t>();
    add(near, *id, triangles - std::min(triangles, of_far));
  }
}

void ReportRecorder::AddKeyFrame(const Frame& frame) {
  if (farthest_m_ == 0) {
    std::vector<float> depths;
    for (int v = 0; v < frame.depth.rows; v += kDepthStride) {
      for (int u = 0; u < frame.depth.cols; u += kDepthStride) {
        if (IsValidDepth(frame.depth.at<float>(v, u)))
          depths.push_back(frame.depth.at<float>(v, u));
      }
    }
    std::sort(depths.begin(), depths.end());
    nearest_m_ = depths.empty() ? 0 : depths[depths.size() / 100];
    farthest_m_ = depths.empty() ? 1 : depths[depths.size() - 1 - depths.size() / 100];
    farthest_m_ = std::max(farthest_m_, nearest_m_ + 0.1F);
  }
  keys_.push_back(
      {{"frame", frame.index},
       {"colour", AddImage(Smaller(frame.colour, kImageWidth, cv::INTER_AREA), false)},
       {"depth", AddImage(Smaller(DrawDepth(frame.depth, nearest_m_, farthest_m_), kImageWidth,
                                  cv::INTER_NEAREST),
                          false)},
       {"mask", AddImage(Smaller(DrawMask(frame.mask), kImageWidth, cv::INTER_NEAREST), true)}});
}

void ReportRecorder::SeeFrame(const Frame& true_frame) {
  sights_.See(true_frame);
  nlohmann::json poses = nlohmann::json::object();
  for (const InstanceId id : result_.truth->moved()) {
    poses[std::to_string(id)] = PoseJson(result_.truth->T_WO(TrackerOf(*result_.truth, id)));
  }
  frames_.push_back({{"frame", true_frame.index},
                     {"T_WC", PoseJson(true_frame.T_WC)},
                     {"T_WO", std::move(poses)}});
}

void ReportRecorder::SeeMap(const CompareRun& run) {
  runs_[IndexOf(run)]["memory_mb"].push_back(
      Rounded(static_cast<double>(run.pipeline.map().Memory().bytes) / 1e6, 100));
}

Expected<void> ReportRecorder::Take(const CompareRun& run, const Evaluation& evaluation,
                                    const Frame& frame) {
  const double scale = std::max(1.0, frame.intrinsics.width / kPictureWidth);
  const auto draw = [&](const TriangleMesh& mesh) {
    return Encoded(DrawScene(mesh, frame.intrinsics, frame.T_WC, scale), false);
  };
  const std::string picture = draw(evaluation.scene);
  if (stills_.empty() || stills_.back() != frame.index) {
    stills_.push_back(frame.index);
    TSDFPP_RETURN_IF_ERROR(
        WriteStill("colour", frame.index,
                   Encoded(Smaller(frame.colour, kPictureWidth, cv::INTER_AREA), false)));
    TSDFPP_RETURN_IF_ERROR(
        WriteStill("mask", frame.index,
                   Encoded(Smaller(DrawMask(frame.mask), kPictureWidth, cv::INTER_NEAREST), true)));
  }
  TSDFPP_RETURN_IF_ERROR(WriteStill(run.FolderName(), frame.index, picture));
  if (std::find(key_frames_.begin(), key_frames_.end(), frame.index) == key_frames_.end()) {
    return {};
  }
  if (keys_.empty() || keys_.back()["frame"] != frame.index) AddKeyFrame(frame);
  nlohmann::json key{{"frame", frame.index}, {"picture", Add(picture)}};
  if (!result_.movers.empty()) key["picture_after"] = Add(draw(evaluation.revealed));
  nlohmann::json chunks = nlohmann::json::array();
  std::size_t left = kTrianglesAKeyFrame;
  for (const InstanceId id : result_.movers) {
    const TriangleMesh faces = FacesOf(evaluation.scene, id);
    if (!faces.triangles.empty()) AddChunks(faces, "mover", kMoverTriangles, chunks);
  }
  const RemovalLayers layers = CutByRemoval(evaluation.scene, evaluation.revealed,
                                            {result_.movers.begin(), result_.movers.end()});
  AddChunks(layers.gone, "gone", kLayerTriangles, chunks);
  AddChunks(layers.revealed, "revealed", kLayerTriangles, chunks);
  const TriangleMesh hole = HoleMesh(*result_.truth, evaluation.table_reconstructed);
  if (!hole.triangles.empty()) {
    nlohmann::json chunk = AddMesh(hole, {});
    chunk["id"] = kBackground;
    chunk["layer"] = "hole";
    chunks.push_back(std::move(chunk));
  }
  for (const nlohmann::json& chunk : chunks) {
    if (chunk["layer"] == "hole") continue;  // a large hole must not cost the map its detail
    left -= std::min(left, chunk["triangles"].get<std::size_t>());
  }
  AddChunks(layers.common, "common", left, chunks);
  key["chunks"] = std::move(chunks);
  runs_[IndexOf(run)]["key_frames"].push_back(std::move(key));
  return {};
}

std::size_t ReportRecorder::IndexOf(const CompareRun& run) const {
  std::size_t r = 0;
  while (result_.runs[r].get() != &run) ++r;
  return r;
}

void ReportRecorder::Forget(const CompareRun& run) {
  runs_.erase(runs_.begin() + static_cast<std::ptrdiff_t>(IndexOf(run)));
}

nlohmann::json ReportRecorder::TruthJson() {
  nlohmann::json truth = nlohmann::json::array();
  for (std::size_t i = 0; i < result_.truth->trackers().size(); ++i) {
    const TrueModel& model = result_.truth->surface(i).model();
    const bool still = !result_.truth->moved().contains(model.info.id);
    TriangleMesh mesh = Decimate(model.mesh_O, kTruthTriangles);
    // What moves stays in its own frame, on a grid of its own.
    if (still) {
      for (Eigen::Vector3f& p : mesh.vertices) {
        p = (result_.truth->T_WO(i) * p.cast<double>()).cast<float>();
      }
    }
    const Eigen::AlignedBox3f box = BoundsOf(mesh);
    const PositionGrid grid = still && Holds(grid_, box) ? grid_ : GridAround(box);
    const PackedMesh packed = Pack(mesh, {}, grid);
    truth.push_back({{"id", model.info.id},
                     {"vertices", packed.vertices},
                     {"triangles", packed.triangles},
                     {"vertex_bytes", Add(packed.vertex_bytes)},
                     {"index_bytes", Add(packed.index_bytes)},
                     {"grid", GridJson(grid)}});
  }
  return truth;
}

void ReportRecorder::AddErrors(const CompareRun& run, nlohmann::json& json) const {
  for (const InstanceId id : result_.truth->moved()) {
    const auto ours = run.pipeline.trajectories().find(run.IdOf(id));
    const auto truth = result_.truth->trajectories().find(id);
    if (ours == run.pipeline.trajectories().end() || truth == result_.truth->trajectories().end()) {
      continue;
    }
    const PosePairs pairs = AnchoredAtFirst(PairByFrame(ours->second, truth->second));
    const std::vector<double> errors_m = TranslationErrors_m(pairs);
    nlohmann::json& list = json["position_error_mm"][std::to_string(id)] = nlohmann::json::array();
    for (std::size_t k = 0; k < errors_m.size(); ++k) {
      list.push_back({pairs.frames[k], Rounded(1e3 * errors_m[k], 1000)});
    }
  }
}

nlohmann::json ReportRecorder::ObjectsJson() const {
  nlohmann::json objects = nlohmann::json::array();
  for (std::size_t i = 0; i < result_.truth->trackers().size(); ++i) {
    const ObjectInfo& info = result_.truth->surface(i).model().info;
    const Colour colour = ObjectColour(info.id);
    objects.push_back({{"id", info.id},
                       {"name", info.name},
                       {"class", info.semantic_class},
                       {"colour", {colour[0], colour[1], colour[2]}},
                       {"moved", result_.truth->moved().contains(info.id)},
                       {"removed", result_.movers.contains(info.id)}});
  }
  return objects;
}

Expected<void> ReportRecorder::Discard() const {
  std::error_code failure;
  std::filesystem::remove_all(out_ / "record", failure);
  if (!failure) return {};
  return EnvironmentError("{} cannot be removed: {}", (out_ / "record").string(),
                          failure.message());
}

Expected<void> ReportRecorder::Write() {
  if (failure_) return tl::unexpected(*failure_);
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const CompareRun& run = *result_.runs[r];
    runs_[r]["all_ms"] = Milliseconds(run.times.All_s());
    runs_[r]["track_ms"] = Milliseconds(run.times.track_s);
    runs_[r]["update_poses_ms"] = Milliseconds(run.times.update_poses_s);
    runs_[r]["fuse_ms"] = Milliseconds(run.times.fuse_s);
    AddErrors(run, runs_[r]);
  }
  const double frames = result_.last_frame - result_.info.first_index + 1;
  nlohmann::json record{{"schema", 1},
                        {"sequence", result_.info.name},
                        {"rate_hz", result_.info.rate_hz},
                        {"intrinsics", IntrinsicsJson(result_.info.intrinsics)},
                        {"grid", GridJson(grid_)},
                        {"error_step_m", kErrorStep_m},
                        {"age_step_frames", frames / kAgeSteps},
                        {"depth_range_m", {Rounded(nearest_m_, 1000), Rounded(farthest_m_, 1000)}},
                        {"objects", ObjectsJson()},
                        {"frames", std::move(frames_)},
                        {"truth", TruthJson()},
                        {"key_frames", std::move(keys_)},
                        {"stills", stills_},
                        {"runs", runs_}};
  TSDFPP_RETURN_IF_ERROR(WriteFile(out_ / "record" / "record.bin", bytes_));
  return WriteFile(out_ / "record" / "record.json", JsonText(record) + "\n");
}

}  // namespace tsdfpp
