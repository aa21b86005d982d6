#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/data_folder.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "core/plain_name.h"
#include "core/ply.h"
#include "sequence/bop_instances.h"
#include "sequence/bop_layout.h"
#include "sequence/dataset_readers.h"
#include "sequence/image_files.h"
#include "sequence/pose_matrix.h"
#include "sequence/text_lines.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr double kNearestObject_m = 0.02;

bool Exists(const fs::path& path) {
  std::error_code code;
  return fs::exists(path, code);
}

// The numbers of a list, or nothing where it is none of this length.
std::optional<std::vector<double>> Numbers(const nlohmann::json& json, const char* key,
                                           std::size_t count) {
  const auto list = json.find(key);
  if (list == json.end() || !list->is_array() || list->size() != count) return std::nullopt;
  std::vector<double> numbers;
  for (const nlohmann::json& number : *list) {
    if (!number.is_number()) return std::nullopt;
    numbers.push_back(number.get<double>());
  }
  return numbers;
}

// R (9 numbers, row-wise) and t (3, millimetres) of a file's object.
Expected<Pose> PoseOf(const nlohmann::json& json, const char* rotation, const char* translation,
                      const std::string& where) {
  const auto r = Numbers(json, rotation, 9);
  const auto t = Numbers(json, translation, 3);
  if (!r || !t) {
    return DataError("{}: expected {} of 9 numbers and {} of 3", where, rotation, translation);
  }
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = (*r)[static_cast<std::size_t>(i)];
  return PoseFromMatrix(matrix, Eigen::Vector3d((*t)[0], (*t)[1], (*t)[2]) / bop::kMillimetres,
                        where);
}

// A file's members by image number.
Expected<std::map<int, nlohmann::json>> ReadByImage(const fs::path& path) {
  TSDFPP_ASSIGN(const nlohmann::json json, ReadJsonObject(path));
  std::map<int, nlohmann::json> images;
  for (const auto& [key, value] : json.items()) {
    const auto number = ParseWholeNumber(key);
    if (!number) return DataError("{}: '{}' is not the number of an image", path.string(), key);
    if (!images.emplace(*number, value).second) {
      return DataError("{}: image {} is there twice", path.string(), *number);
    }
  }
  return images;
}

class BopOpener {
 public:
  BopOpener(fs::path scene, const SequenceOptions& options, SequenceNotes& notes)
      : scene_(std::move(scene)), options_(options), notes_(notes) {
    sequence_.format = DatasetFormat::kBop;
    const fs::path absolute = AbsolutePath(scene_ / "").lexically_normal().parent_path();
    sequence_.size_source = "as the first depth image";
    sequence_.rate_hz = kUsualRate_hz;
    dataset_ = Exists(scene_ / "models") ? scene_ : absolute.parent_path().parent_path();
    // A scene's own name is a number only.
    sequence_.name = NameOfFolder(absolute);
    if (dataset_ != scene_) sequence_.name = NameOfFolder(dataset_) + "-" + sequence_.name;
  }

  Expected<std::unique_ptr<DatasetSource>> Open() {
    // Where a scene alone is named, its models lie beside it in the dataset.
    TSDFPP_ASSIGN(const fs::path models, DataFolder(dataset_).Find("models"));
    sequence_.has_truth = Exists(models);
    if (sequence_.has_truth) TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(models));
    TSDFPP_RETURN_IF_ERROR(ReadCameras());
    if (Exists(scene_ / bop::kTruth)) {
      TSDFPP_RETURN_IF_ERROR(ReadTruth());
    } else {
      notes_.push_back(
          fmt::format("{}: no {}, objects are not known", sequence_.name, bop::kTruth));
    }
    if (options_.check) TSDFPP_RETURN_IF_ERROR(CheckObjectPoses());
    auto objects = bop::AssignIds(images_);
    if (!objects) {
      return DataError("{}: {}", (scene_ / bop::kTruth).string(), objects.error().message);
    }
    objects_ = std::move(*objects);
    TSDFPP_RETURN_IF_ERROR(SetObjects());
    TSDFPP_RETURN_IF_ERROR(SetMasks());
    sequence_.truth = [objects = objects_, dataset = dataset_](const SequenceInfo& info) {
      return ReadModels(info, objects, dataset);
    };
    return MakeFileSource(std::move(sequence_), options_, notes_);
  }

 private:
  Expected<void> ReadCameras() {
    const fs::path path = scene_ / bop::kCamera;
    TSDFPP_ASSIGN(const auto cameras, ReadByImage(path));
    std::size_t placed = 0;
    for (const auto& [number, json] : cameras) {
      const std::string where = fmt::format("{}: image {}", path.string(), number);
      if (!json.is_object()) return DataError("{}: not a JSON object", where);
      const auto k = Numbers(json, "cam_K", 9);
      const auto scale = json.find("depth_scale");
      if (!k || scale == json.end() || !scale->is_number()) {
        return DataError("{}: expected cam_K of 9 numbers and depth_scale", where);
      }
      if (!((*k)[0] > 0) || !((*k)[4] > 0) || !(scale->get<double>() > 0)) {
        return DataError("{}: focal lengths {} and {} and depth_scale {}, expected all over 0",
                         where, (*k)[0], (*k)[4], scale->get<double>());
      }
      if ((*k)[1] != 0 || (*k)[3] != 0 || (*k)[6] != 0 || (*k)[7] != 0 || (*k)[8] != 1) {
        return DataError("{}: cam_K is {}, expected a camera without skew: fx 0 cx 0 fy cy 0 0 1",
                         where, fmt::join(*k, " "));
      }
      FrameFiles frame;
      frame.number = number;
      frame.time_s = number / kUsualRate_hz;
      frame.camera = {0, 0, (*k)[0], (*k)[4], (*k)[2], (*k)[5]};
      frame.depth_units_per_m = bop::kMillimetres / scale->get<double>();
      frame.depth = scene_ / bop::ImageFile("depth", number);
      TSDFPP_ASSIGN(frame.colour, OnlyOneOf(scene_ / bop::ImageFile("rgb", number),
                                            scene_ / bop::ImageFile("rgb", number, "jpg")));
      if (json.contains("cam_R_w2c")) {
        TSDFPP_ASSIGN(const Pose T_CW, PoseOf(json, "cam_R_w2c", "cam_t_w2c", where));
        frame.T_WC = T_CW.inverse();
        ++placed;
      }
      images_[number].T_WC = frame.T_WC;
      sequence_.frames.push_back(std::move(frame));
    }
    if (placed != 0 && placed != cameras.size()) {
      return DataError("{}: {} of {} images have cam_R_w2c, expected all or none", path.string(),
                       placed, cameras.size());
    }
    if (placed != 0 && options_.fixed_camera) {
      return FixedCameraWithPoses(path);
    }
    if (placed == 0 && !options_.fixed_camera) {
      return DataError(
          "{}: no cam_R_w2c and cam_t_w2c, so where the camera was is not known; expected them, "
          "or leave to take the camera as fixed",
          path.string());
    }
    return {};
  }

  Expected<void> ReadTruth() {
    const fs::path path = scene_ / bop::kTruth;
    TSDFPP_ASSIGN(const auto lists, ReadByImage(path));
    for (const auto& [number, list] : lists) {
      const auto image = images_.find(number);
      const std::string where = fmt::format("{}: image {}", path.string(), number);
      if (image == images_.end()) return DataError("{} is not in {}", where, bop::kCamera);
      if (!list.is_array()) return DataError("{}: not a list of objects", where);
      if (list.size() > bop::kMostInstances) {
        return DataError("{}: lists {} objects, expected {} at most", where, list.size(),
                         bop::kMostInstances);
      }
      int place = 0;
      for (const nlohmann::json& json : list) {
        const std::string entry = fmt::format("{}, object {}", where, place);
        const auto id = json.is_object() ? json.find("obj_id") : json.end();
        if (!json.is_object() || id == json.end() || !id->is_number_integer() ||
            id->get<std::int64_t>() < 1 || id->get<std::int64_t>() > bop::kMostObjects) {
          return DataError("{}: expected an obj_id from 1 to {}", entry, bop::kMostObjects);
        }
        TSDFPP_ASSIGN(const Pose T_CO, PoseOf(json, "cam_R_m2c", "cam_t_m2c", entry));
        image->second.instances.push_back({id->get<int>(), place++, T_CO, kNoInstance});
      }
    }
    for (FrameFiles& frame : sequence_.frames) {
      if (!lists.contains(frame.number)) {
        return DataError("{}: image {} of {} is missing", path.string(), frame.number,
                         bop::kCamera);
      }
    }
    return {};
  }

  // Objects that were labelled are before the camera, and further away than a few millimetres.
  Expected<void> CheckObjectPoses() const {
    std::size_t all = 0;
    std::size_t behind = 0;
    std::size_t near = 0;
    for (const auto& [number, image] : images_) {
      for (const bop::Instance& instance : image.instances) {
        ++all;
        if (instance.T_CO.translation().z() <= 0) ++behind;
        if (instance.T_CO.translation().norm() < kNearestObject_m) ++near;
      }
    }
    const std::string path = (scene_ / bop::kTruth).string();
    if (2 * behind > all) {
      return DataError(
          "{}: {} of {} objects are behind the camera: cam_R_m2c and cam_t_m2c look inverted, "
          "expected model-to-camera",
          path, behind, all);
    }
    if (2 * near > all) {
      return DataError(
          "{}: {} of {} objects are less than {:g} mm from the camera: cam_t_m2c looks like "
          "metres, expected millimetres",
          path, near, all, kNearestObject_m * bop::kMillimetres);
    }
    return {};
  }

  Expected<void> SetObjects() {
    const fs::path path = dataset_ / bop::kModelsInfo;
    nlohmann::json models = nlohmann::json::object();
    if (Exists(path)) {
      TSDFPP_ASSIGN(models, ReadJsonObject(path));
    }
    std::map<int, int> instances;  // by obj_id
    for (const auto& [id, obj_id] : objects_) {
      std::string name = fmt::format("obj_{:06d}", obj_id);
      std::string semantic_class = name;
      const auto model = models.find(std::to_string(obj_id));
      if (model != models.end() && model->is_object()) {
        // Only our own files have these.
        name = model->value("name", nlohmann::json(name)).is_string() ? model->value("name", name)
                                                                      : name;
        semantic_class = model->contains("class") && model->at("class").is_string()
                             ? model->at("class").get<std::string>()
                             : semantic_class;
        const std::string what = fmt::format("{}: object {}", path.string(), obj_id);
        TSDFPP_RETURN_IF_ERROR(CheckPlainName(name, what));
        TSDFPP_RETURN_IF_ERROR(CheckLabel(semantic_class, what + ": the class"));
      }
      const int nth = ++instances[obj_id];
      if (nth > 1) name += fmt::format("_{}", nth);
      sequence_.objects.push_back({id, name, semantic_class});
    }
    for (FrameFiles& frame : sequence_.frames) {
      const bop::Image& image = images_.at(frame.number);
      for (const bop::Instance& instance : image.instances) {
        frame.T_WO[instance.id] = image.T_WC * instance.T_CO;
      }
    }
    return {};
  }

  // mask_visib/ where it is there; else mask/, whose silhouettes are painted from far to near.
  Expected<void> SetMasks() {
    if (objects_.empty()) return {};
    TSDFPP_ASSIGN(const auto visible_names, NamesIn(scene_ / "mask_visib"));
    TSDFPP_ASSIGN(const auto whole_names, NamesIn(scene_ / "mask"));
    const bool visible = !visible_names.empty();
    if (!visible && whole_names.empty()) return {};
    const char* folder = visible ? "mask_visib" : "mask";
    if (!visible) {
      notes_.push_back(fmt::format(
          "{}: no mask_visib/; of the whole silhouettes in mask/ the nearer object's goes in front",
          sequence_.name));
    }
    sequence_.has_masks = true;
    for (FrameFiles& frame : sequence_.frames) {
      std::vector<bop::Instance> instances = images_.at(frame.number).instances;
      std::stable_sort(instances.begin(), instances.end(),
                       [](const bop::Instance& a, const bop::Instance& b) {
                         return a.T_CO.translation().z() > b.T_CO.translation().z();
                       });
      for (const bop::Instance& instance : instances) {
        const fs::path path = scene_ / bop::MaskFile(folder, frame.number, instance.place);
        if (!Exists(path)) {
          return DataError("{}: no such mask, though {} lists object {} of image {} there",
                           path.string(), bop::kTruth, instance.place, frame.number);
        }
        frame.masks.emplace_back(path, instance.id);
      }
    }
    return {};
  }

  static Expected<std::vector<TrueModel>> ReadModels(const SequenceInfo& info,
                                                     const std::map<InstanceId, int>& objects,
                                                     const fs::path& dataset) {
    std::vector<TrueModel> models;
    for (const ObjectInfo& object : info.objects) {
      fs::path path = dataset / bop::kBackgroundModel;
      if (object.id == kBackground) {
        if (!Exists(path)) continue;  // no other's dataset has it
      } else {
        path = dataset / bop::ModelFile(objects.at(object.id));
      }
      TSDFPP_ASSIGN(TrueModel model, ReadTrueModel(path, object));
      for (Eigen::Vector3f& vertex : model.mesh_O.vertices) {
        vertex = (vertex.cast<double>() / bop::kMillimetres).cast<float>();
      }
      models.push_back(std::move(model));
    }
    if (models.empty()) {
      return DataError(
          "{}: no true surfaces here (obj_000001.ply and so on); the sequence can be mapped but "
          "not "
          "compared with truth",
          (dataset / "models").string());
    }
    return models;
  }

  fs::path scene_;
  fs::path dataset_;
  const SequenceOptions& options_;
  SequenceNotes& notes_;
  FileSequence sequence_;
  std::map<int, bop::Image> images_;
  std::map<InstanceId, int> objects_;
};

// The scene folders two levels below, e.g. test/000001.
Expected<std::vector<fs::path>> ScenesBelow(const fs::path& folder) {
  std::vector<fs::path> scenes;
  TSDFPP_ASSIGN(const auto splits, NamesIn(folder));
  for (const std::string& split : splits) {
    TSDFPP_ASSIGN(const auto names, NamesIn(folder / split));
    for (const std::string& scene : names) {
      if (Exists(folder / split / scene / bop::kCamera)) scenes.push_back(folder / split / scene);
    }
  }
  return scenes;
}

}  // namespace

Expected<std::unique_ptr<DatasetSource>> OpenBop(const fs::path& folder,
                                                 const SequenceOptions& options,
                                                 SequenceNotes& notes) {
  if (Exists(folder / bop::kCamera)) return BopOpener(folder, options, notes).Open();
  TSDFPP_ASSIGN(const std::vector<fs::path> scenes, ScenesBelow(folder));
  if (scenes.size() == 1) return BopOpener(scenes.front(), options, notes).Open();
  return DataError("{}: no {} here and {} scenes below, expected the folder of one scene",
                   folder.string(), bop::kCamera, scenes.size());
}

}  // namespace tsdfpp
