#include <nlohmann/json.hpp>
#include <set>

#include "core/files.h"
#include "core/json_text.h"
#include "core/ply.h"
#include "sequence/bop_layout.h"
#include "sequence/dataset_writers.h"
#include "sequence/image_files.h"
#include "sequence/mesh_extent.h"
#include "sequence/silhouette.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kScene = "test/000000";

Json RowWise(const Eigen::Matrix3d& matrix) {
  Json list = Json::array();
  for (int i = 0; i < 9; ++i) list.push_back(matrix(i / 3, i % 3));
  return list;
}

Json Millimetres(const Eigen::Vector3d& metres) {
  const Eigen::Vector3d mm = bop::kMillimetres * metres;
  return Json::array({mm.x(), mm.y(), mm.z()});
}

// x, y, width and height of what is set; BOP's -1 -1 -1 -1 where nothing is.
Json BoxOf(const cv::Mat& mask, int left, int top) {
  int x0 = mask.cols;
  int x1 = -1;
  int y0 = mask.rows;
  int y1 = -1;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (mask.at<std::uint8_t>(y, x) == 0) continue;
      x0 = std::min(x0, x);
      x1 = std::max(x1, x);
      y0 = std::min(y0, y);
      y1 = std::max(y1, y);
    }
  }
  if (x1 < 0) return Json::array({-1, -1, -1, -1});
  return Json::array({x0 + left, y0 + top, x1 - x0 + 1, y1 - y0 + 1});
}

class BopWriter : public DatasetWriter {
 public:
  BopWriter(const SequenceInfo& info, fs::path folder, std::vector<TrueModel> models)
      : info_(info), folder_(std::move(folder)), models_(std::move(models)) {}

  double depth_units_per_m() const override { return kBopExportUnits; }

  Expected<void> Add(const Frame& frame) override {
    const std::string name = fmt::format("frame {}", frame.index);
    TSDFPP_RETURN_IF_ERROR(WriteEncoded(InScene(bop::ImageFile("rgb", frame.index)),
                                        EncodeColour(frame.colour, name)));
    const cv::Mat units = DepthToUnits(frame.depth, kBopExportUnits, 65535, loss_);
    TSDFPP_RETURN_IF_ERROR(
        WriteEncoded(InScene(bop::ImageFile("depth", frame.index)), EncodePng(units, name)));
    const Intrinsics& camera = frame.intrinsics;
    const Pose T_CW = frame.T_WC.inverse();
    const std::string key = std::to_string(frame.index);
    cameras_[key] = {{"cam_K", Json::array({camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy,
                                            0.0, 0.0, 1.0})},
                     {"depth_scale", bop::kMillimetres / kBopExportUnits},
                     {"cam_R_w2c", RowWise(T_CW.linear())},
                     {"cam_t_w2c", Millimetres(T_CW.translation())}};
    truth_[key] = Json::array();
    infos_[key] = Json::array();
    int place = 0;
    for (const auto& [id, T_WO] : frame.T_WO) {
      if (id == kBackground) continue;
      if (id > bop::kMostObjects) {
        return DataError("{}: object id {}, BOP's obj_id is 1 to {} here", name, id,
                         bop::kMostObjects);
      }
      const Pose T_CO = T_CW * T_WO;
      truth_[key].push_back({{"cam_R_m2c", RowWise(T_CO.linear())},
                             {"cam_t_m2c", Millimetres(T_CO.translation())},
                             {"obj_id", id}});
      TSDFPP_RETURN_IF_ERROR(AddMasks(frame, units, id, T_CO, place, infos_[key]));
      ++place;
    }
    if (frame.mask.empty()) return {};
    // Of what the sequence does not list, too.
    std::set<InstanceId> ids;
    InstanceId last = kBackground;
    for (const InstanceId id : cv::Mat_<InstanceId>(frame.mask)) {
      if (id != last) ids.insert(id);
      last = id;
    }
    if (ids.contains(kNoInstance)) ++with_no_instance_;
    for (const InstanceId id : ids) {
      const bool is_object = id != kBackground && id != kNoInstance;
      if (is_object && !frame.T_WO.contains(id)) ++without_pose_[id];
    }
    return {};
  }

  Expected<void> Finish(ExportReport& report) override {
    const Intrinsics& camera = info_.intrinsics;
    const Json common = {{"cx", camera.cx},
                         {"cy", camera.cy},
                         {"depth_scale", bop::kMillimetres / kBopExportUnits},
                         {"fx", camera.fx},
                         {"fy", camera.fy},
                         {"height", camera.height},
                         {"width", camera.width}};
    TSDFPP_RETURN_IF_ERROR(WriteFile(folder_ / "camera.json", JsonText(common, 2) + "\n"));
    TSDFPP_RETURN_IF_ERROR(WriteFile(InScene(bop::kCamera), JsonText(cameras_, 1) + "\n"));
    TSDFPP_RETURN_IF_ERROR(WriteFile(InScene(bop::kTruth), JsonText(truth_, 1) + "\n"));
    TSDFPP_RETURN_IF_ERROR(WriteFile(InScene(bop::kTruthInfo), JsonText(infos_, 1) + "\n"));
    TSDFPP_RETURN_IF_ERROR(WriteModels());
    for (const auto& [id, frames] : without_pose_) {
      report.left_out.push_back(
          fmt::format("the mask of object {} on {} frames, where it has no pose", id, frames));
    }
    if (with_no_instance_ > 0) {
      report.left_out.push_back(
          fmt::format("the pixels of no instance (id {}) on {} frames, which become background",
                      kNoInstance, with_no_instance_));
    }
    if (models_.empty()) report.left_out.emplace_back("mask/ and what needs true surfaces");
    return {};
  }

 private:
  fs::path InScene(const std::string& file) const { return folder_ / kScene / file; }

  const TrueModel* ModelOf(InstanceId id) const {
    const auto found = std::find_if(models_.begin(), models_.end(),
                                    [&](const TrueModel& model) { return model.info.id == id; });
    return found == models_.end() ? nullptr : &*found;
  }

  // As bop_toolkit's calc_gt_info.py: silhouettes are counted on a canvas three times as wide and
  // high, so that an object that is cut by the image's edge is not taken for a whole one.
  Expected<void> AddMasks(const Frame& frame, const cv::Mat& units, InstanceId id, const Pose& T_CO,
                          int place, Json& infos) {
    const std::string name = fmt::format("frame {}", frame.index);
    const int width = frame.intrinsics.width;
    const int height = frame.intrinsics.height;
    Json info = Json::object();
    const TrueModel* model = ModelOf(id);
    long all = 0;
    if (model != nullptr) {
      Intrinsics canvas = frame.intrinsics;
      canvas.width *= 3;
      canvas.height *= 3;
      canvas.cx += width;
      canvas.cy += height;
      const cv::Mat large = Silhouette(model->mesh_O, T_CO, canvas);
      const cv::Mat silhouette = large(cv::Rect(width, height, width, height)).clone();
      TSDFPP_RETURN_IF_ERROR(WriteEncoded(InScene(bop::MaskFile("mask", frame.index, place)),
                                          EncodePng(silhouette, name)));
      all = cv::countNonZero(large);
      info["bbox_obj"] = BoxOf(large, -width, -height);
      info["px_count_all"] = all;
      info["px_count_valid"] = cv::countNonZero(silhouette & (units > 0));
    }
    if (!frame.mask.empty()) {
      const cv::Mat visible = frame.mask == id;
      TSDFPP_RETURN_IF_ERROR(WriteEncoded(InScene(bop::MaskFile("mask_visib", frame.index, place)),
                                          EncodePng(visible, name)));
      const long seen = cv::countNonZero(visible);
      info["bbox_visib"] = BoxOf(visible, 0, 0);
      info["px_count_visib"] = seen;
      if (model != nullptr) {
        info["visib_fract"] =
            all > 0 ? std::min(1.0, static_cast<double>(seen) / static_cast<double>(all)) : 0.0;
      }
    }
    infos.push_back(std::move(info));
    return {};
  }

  Expected<void> WriteModels() {
    Json infos = Json::object();
    for (const ObjectInfo& object : info_.objects) {
      if (object.id == kBackground) continue;
      // Names are ours; others' tools look at their own keys.
      infos[std::to_string(object.id)] = {{"name", object.name}, {"class", object.semantic_class}};
    }
    for (const TrueModel& model : models_) {
      TrueModel scaled = model;
      for (Eigen::Vector3f& vertex : scaled.mesh_O.vertices) {
        vertex = (vertex.cast<double>() * bop::kMillimetres).cast<float>();
      }
      const bool background = model.info.id == kBackground;
      const fs::path path =
          folder_ / (background ? bop::kBackgroundModel : bop::ModelFile(model.info.id));
      TSDFPP_RETURN_IF_ERROR(WriteTrueModel(path, scaled));
      TSDFPP_RETURN_IF_ERROR(SayMillimetres(path));
      if (background) continue;
      const MeshExtent extent = ExtentOf(scaled.mesh_O);
      Json& info = infos[std::to_string(model.info.id)];
      info["diameter"] = extent.diameter;
      constexpr const char* kAxes[] = {"x", "y", "z"};
      for (int axis = 0; axis < 3; ++axis) {
        info[std::string("min_") + kAxes[axis]] = extent.min[axis];
        info[std::string("size_") + kAxes[axis]] = extent.max[axis] - extent.min[axis];
      }
    }
    return WriteFile(folder_ / bop::kModelsInfo, JsonText(infos, 2) + "\n");
  }

  // Our PLY files say their unit in a comment.
  static Expected<void> SayMillimetres(const fs::path& path) {
    TSDFPP_ASSIGN(std::string bytes, ReadFile(path));
    const std::string metres = "comment tsdfpp, metres";
    const std::size_t at = bytes.find(metres);
    if (at == std::string::npos) return {};
    bytes.replace(at, metres.size(), "comment tsdfpp, millimetres");
    return WriteFile(path, bytes);
  }

  SequenceInfo info_;
  fs::path folder_;
  std::vector<TrueModel> models_;
  std::map<InstanceId, int> without_pose_;  // frames with a mask of it, but no pose
  int with_no_instance_ = 0;                // frames with pixels that are of no instance
  Json cameras_ = Json::object();
  Json truth_ = Json::object();
  Json infos_ = Json::object();
};

}  // namespace

std::unique_ptr<DatasetWriter> MakeBopWriter(const SequenceInfo& info, fs::path folder,
                                             std::vector<TrueModel> models) {
  return std::make_unique<BopWriter>(info, std::move(folder), std::move(models));
}

}  // namespace tsdfpp
