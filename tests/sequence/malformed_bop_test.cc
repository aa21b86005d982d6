// Damaged BOP sets.
#include "tests/sequence/malformed.h"

namespace tsdfpp::test {
namespace {

TEST(Malformed, Bop) {
  const std::string scene = "test/000000/";
  const std::string at = In(scene, "");
  const auto first = [](const char* key, const nlohmann::json& value) {
    return [=](nlohmann::json& json) { json["0"][key] = value; };
  };
  const auto object = [](const char* key, const nlohmann::json& value) {
    return [=](nlohmann::json& json) { json["1"][0][key] = value; };
  };
  CheckAll(
      Exported(DatasetFormat::kBop),
      {
          {Text(scene + "scene_camera.json", "{"), at + "scene_camera.json: not a JSON object"},
          {Text(scene + "scene_camera.json", "{\"first\": {}}"),
           at + "scene_camera.json: 'first' is not the number of an image"},
          {Json(scene + "scene_camera.json", [](auto& json) { json["01"] = json["1"]; }),
           at + "scene_camera.json: image 1 is there twice"},
          {Copy(scene + "rgb/000001.png", scene + "rgb/000001.jpg"),
           at + "rgb/000001.png: there is 000001.jpg as well, expected one of them"},
          {Json(scene + "scene_camera.json", first("cam_K", {1, 2, 3})),
           at + "scene_camera.json: image 0: expected cam_K of 9 numbers and depth_scale"},
          {Json(scene + "scene_camera.json", first("cam_K", {60, 0.5, 4, 0, 61, 3, 0, 0, 1})),
           at + "scene_camera.json: image 0: cam_K is 60 0.5 4 0 61 3 0 0 1, expected a camera "
                "without skew: fx 0 cx 0 fy cy 0 0 1"},
          {Json(scene + "scene_camera.json", first("depth_scale", "0.1")),
           at + "scene_camera.json: image 0: expected cam_K of 9 numbers and depth_scale"},
          {Json(scene + "scene_camera.json", first("depth_scale", 0)),
           at + "scene_camera.json: image 0: focal lengths 60 and 61 and depth_scale 0, expected "
                "all over 0"},
          {Json(scene + "scene_camera.json",
                [](nlohmann::json& json) { json["0"].erase("cam_R_w2c"); }),
           at + "scene_camera.json: 2 of 3 images have cam_R_w2c, expected all or none"},
          {Json(scene + "scene_camera.json",
                [](nlohmann::json& json) {
                  for (auto& image : json) image.erase("cam_R_w2c");
                }),
           at + "scene_camera.json: no cam_R_w2c and cam_t_w2c, so where the camera was is not "
                "known; expected them, or leave to take the camera as fixed"},
          {Json(scene + "scene_camera.json", first("cam_R_w2c", {1, 0, 0, 0, 1, 0, 0, 0, 2})),
           at + "scene_camera.json: image 0: the rotation is not orthonormal (R^T R is off by 3, "
                "allowed 0.002)"},
          {Json(scene + "scene_camera.json", first("cam_R_w2c", {1, 0, 0, 0, 1, 0, 0, 0, -1})),
           at + "scene_camera.json: image 0: the rotation is a reflection (determinant -1), "
                "expected +1"},
          {Json(scene + "scene_camera.json", first("cam_t_w2c", {1, 2})),
           at + "scene_camera.json: image 0: expected cam_R_w2c of 9 numbers and cam_t_w2c of 3"},
          {Json(scene + "scene_gt.json", object("obj_id", 0)),
           at + "scene_gt.json: image 1, object 0: expected an obj_id from 1 to 30000"},
          {Json(scene + "scene_gt.json", object("obj_id", "cup")),
           at + "scene_gt.json: image 1, object 0: expected an obj_id from 1 to 30000"},
          {Json(scene + "scene_gt.json", object("cam_t_m2c", nullptr)),
           at + "scene_gt.json: image 1, object 0: expected cam_R_m2c of 9 numbers and cam_t_m2c "
                "of 3"},
          {Json(scene + "scene_gt.json", [](nlohmann::json& json) { json["7"] = json["0"]; }),
           at + "scene_gt.json: image 7 is not in scene_camera.json"},
          {Json(scene + "scene_gt.json", [](nlohmann::json& json) { json.erase("2"); }),
           at + "scene_gt.json: image 2 of scene_camera.json is missing"},
          {Json(scene + "scene_gt.json", [](nlohmann::json& json) { json["1"] = 5; }),
           at + "scene_gt.json: image 1: not a list of objects"},
          {Json(scene + "scene_gt.json",
                [](nlohmann::json& json) {
                  for (auto& image : json) {
                    for (auto& entry : image) entry["cam_t_m2c"][2] = -900;
                  }
                }),
           at + "scene_gt.json: 6 of 6 objects are behind the camera: cam_R_m2c and cam_t_m2c look "
                "inverted, expected model-to-camera"},
          {Json(scene + "scene_gt.json",
                [](nlohmann::json& json) {
                  for (auto& image : json) {
                    for (auto& entry : image) entry["cam_t_m2c"] = {0.1, 0.1, 0.9};
                  }
                }),
           at +
               "scene_gt.json: 6 of 6 objects are less than 20 mm from the camera: cam_t_m2c looks "
               "like metres, expected millimetres"},
          {Remove(scene + "mask_visib/000001_000001.png"),
           at + "mask_visib/000001_000001.png: no such mask, though scene_gt.json lists object 1 "
                "of image 1 there"},
          {Cut(scene + "mask_visib/000001_000001.png"),
           at + "mask_visib/000001_000001.png: cannot be decoded as an image"},
          {Image(scene + "depth/000001.png", kSmallDepth),
           at + "depth/000001.png: the image is 32x24, expected 64x48 (as 000000.png)"},
          {Remove(scene + "rgb/000001.png"), at + "rgb/000001.png: no such image"},
          {Text("models/models_info.json", "[]"), "@/models/models_info.json: not a JSON object"},
          {Json("models/models_info.json", [](auto& json) { json["8"]["name"] = "../../pwned"; }),
           "@/models/models_info.json: object 8: the name '../../pwned' holds a slash, expected "
           "one "
           "that can be a file's name"},
          {Json("models/models_info.json", [](auto& json) { json["8"]["class"] = "a\nb"; }),
           "@/models/models_info.json: object 8: the class 'a b' holds a control character"},
      });
}

TEST(Malformed, BopTruth) {
  const TempFolder folder;
  BoxSource source(2);
  const fs::path set = folder / "set";
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kBop, set).has_value());
  fs::remove(set / "models/obj_000008.ply");
  const auto read = OpenSequence(set).value();
  const auto truth = read->Truth();
  ASSERT_FALSE(truth.has_value());
  EXPECT_EQ(truth.error().kind, ErrorKind::kData);
  EXPECT_EQ(Strip(truth.error().message, set.string()), "@/models/obj_000008.ply: no such file");
  // Nor is it left out of an export without a word, as what there is not is.
  const auto exported = ExportSequence(*read, DatasetFormat::kTum, folder / "tum");
  ASSERT_FALSE(exported.has_value());
  EXPECT_EQ(exported.error().message, truth.error().message);
  EXPECT_FALSE(fs::exists(folder / "tum"));
  fs::remove_all(set / "models");
  EXPECT_TRUE(ExportSequence(*OpenSequence(set).value(), DatasetFormat::kTum, folder / "tum"));
}

}  // namespace
}  // namespace tsdfpp::test
