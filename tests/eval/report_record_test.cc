// The recording of a comparison and the film made of it: sizes, and what the layers mean.
#include "eval/compare/report_record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/videoio.hpp>

#include "core/files.h"
#include "eval/compare/compare.h"
#include "eval/report/film_file.h"
#include "eval/report/recording.h"
#include "eval/report/report_video.h"
#include "eval/run/open_source.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/unpacked_mesh.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

using nlohmann::json;
using test::AreaOf;
using test::TempFolder;
using test::Unpack;

TEST(KeyFrames, AreSpreadAndHoldTheExaminedAndTheLast) {
  std::vector<int> evaluated;
  for (int i = 1; i <= 48; ++i) evaluated.push_back(10 * i);
  const std::vector<int> chosen = ChooseKeyFrames(evaluated, 250, 10);
  EXPECT_EQ(chosen.size(), 10U);
  EXPECT_EQ(chosen.back(), 480);
  EXPECT_TRUE(std::find(chosen.begin(), chosen.end(), 250) != chosen.end());
  EXPECT_TRUE(std::is_sorted(chosen.begin(), chosen.end()));
  EXPECT_EQ(ChooseKeyFrames({4, 8}, 8, 10), (std::vector<int>{4, 8}));
  EXPECT_EQ(ChooseKeyFrames({7}, std::nullopt, 10), (std::vector<int>{7}));
}

// A car drives over a table; the baseline loses some of it. The red layer of the recording is what
// the score counts: the same area, but for the stated size of its squares.
TEST(RecordedComparison, HoldsEachMapWithinItsTrianglesAndTheHoleOfTheScore) {
  const TempFolder folder;
  auto source = OpenSource(TSDFPP_SOURCE_DIR "/scenes/mini.toml");
  ASSERT_TRUE(source.has_value()) << source.error().message;
  CompareConfig config;
  config.methods = {Method::kTsdf, Method::kTsdfppAnchored};
  config.profiles = {"paper"};
  config.every = 8;
  config.until = "16";
  config.record = true;
  const auto result = RunCompare(**source, config, folder.path(), "tsdfpp compare mini", {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  std::vector<double> holes_cm2;
  for (const auto& run : result->runs) {
    holes_cm2.push_back(*run->evaluations.back().objects.front().preserved.hole_area_cm2.value);
  }
  const auto recording = ReadRecording(folder.path());
  ASSERT_TRUE(recording.has_value()) << recording.error().message;
  ASSERT_TRUE(recording->has_value());
  const Recording& record = **recording;
  EXPECT_EQ(record.KeyFrames(), (std::vector<int>{8, 16}));
  EXPECT_EQ(record.json["frames"].size(), 16U);
  ASSERT_EQ(record.json["runs"].size(), 2U);
  for (const json& run : record.json["runs"]) {
    EXPECT_EQ(run["memory_mb"].size(), 16U);
    EXPECT_EQ(run["fuse_ms"].size(), 16U);
    for (const json& key : run["key_frames"]) {
      std::size_t triangles = 0;
      for (const json& chunk : key["chunks"]) {
        if (chunk["layer"] != "hole") triangles += chunk["triangles"].get<std::size_t>();
      }
      EXPECT_GT(triangles, 1000U);
      EXPECT_LE(triangles, 26000U);  // some 25,000: borders are kept
    }
  }

  constexpr double kSquares = 1.3 * 1.3;
  constexpr double kQuantisation = 0.1;  // positions on a 0.1 mm grid, squares of some 6 mm
  const PositionGrid grid{{record.json["grid"]["origin_m"][0].get<float>(),
                           record.json["grid"]["origin_m"][1].get<float>(),
                           record.json["grid"]["origin_m"][2].get<float>()},
                          record.json["grid"]["step_m"].get<float>()};
  EXPECT_GT(holes_cm2[0], 20);  // the baseline loses some of the table: there is a hole to compare
  for (std::size_t r = 0; r < 2; ++r) {
    double area_cm2 = 0;
    for (const json& chunk : record.json["runs"][r]["key_frames"].back()["chunks"]) {
      if (chunk["layer"] != "hole") continue;
      const auto slice = [&](const char* name) {
        return record.bytes.substr(chunk[name][0].get<std::size_t>(),
                                   chunk[name][1].get<std::size_t>());
      };
      area_cm2 += 1e4 * AreaOf(Unpack(slice("vertex_bytes"), chunk["vertices"].get<std::size_t>(),
                                      slice("index_bytes"), chunk["triangles"].get<std::size_t>()),
                               grid);
    }
    EXPECT_NEAR(area_cm2 / kSquares, holes_cm2[r], kQuantisation * holes_cm2[r] + 0.5);
  }

  // The same recording as a film: H.264, as long as it says, and its last picture is of the
  // removal.
  const std::filesystem::path file = folder / "film.mp4";
  const auto video = WriteReportVideo(folder.path(), file);
  ASSERT_TRUE(video.has_value()) << video.error().message;
  cv::VideoCapture film(file.string());
  ASSERT_TRUE(film.isOpened());
  EXPECT_EQ(static_cast<int>(film.get(cv::CAP_PROP_FOURCC)),
            cv::VideoWriter::fourcc('a', 'v', 'c', '1'));
  EXPECT_EQ(film.get(cv::CAP_PROP_FRAME_WIDTH), video->width);
  EXPECT_EQ(film.get(cv::CAP_PROP_FRAME_HEIGHT), video->height);
  cv::Mat image;
  cv::Mat first;
  int frames = 0;
  for (cv::Mat next; film.read(next); ++frames) {
    image = next.clone();
    if (first.empty()) first = image;
  }
  EXPECT_EQ(frames, video->frames);
  constexpr double kCodecNoise = 2;  // grey values, mean over the picture
  EXPECT_GT(cv::norm(image, first, cv::NORM_L1) / static_cast<double>(image.total()), kCodecNoise);
  // A still of somebody else's is none of the run.
  const std::filesystem::path still = folder / "record" / "stills" / StillName("mask", 16);
  const std::string own = ReadFile(still).value();
  ASSERT_TRUE(WriteFile(still, own + "x").has_value());
  const auto foreign = WriteReportVideo(folder.path(), folder / "other.mp4");
  ASSERT_FALSE(foreign.has_value());
  EXPECT_NE(foreign.error().message.find("record/stills/mask-000016.webp has"), std::string::npos)
      << foreign.error().message;
  ASSERT_TRUE(WriteFile(still, own).has_value());
  // A picture that is none has a sentence with its file and map.
  const std::filesystem::path pictures = folder / "record" / "record.bin";
  const json& last_map = record.json["runs"].back();
  const json& place = last_map["key_frames"].back()["picture_after"];
  std::string spoilt = record.bytes;
  spoilt.replace(place[0].get<std::size_t>(), place[1].get<std::size_t>(),
                 std::string(place[1].get<std::size_t>(), '\0'));
  ASSERT_TRUE(WriteFile(pictures, spoilt).has_value());
  const auto no_picture = WriteReportVideo(folder.path(), folder / "other.mp4");
  ASSERT_FALSE(no_picture.has_value());
  EXPECT_NE(no_picture.error().message.find(
                fmt::format("record.bin: the picture of map '{}' after the removal of frame 16",
                            last_map["folder"].get<std::string>())),
            std::string::npos)
      << no_picture.error().message;
  ASSERT_TRUE(WriteFile(pictures, record.bytes).has_value());
  // As long as the record says, were it believed.
  const std::string whole = ReadFile(folder / "record/record.json").value();
  const std::string note = ReadFile(folder / "run.json").value();
  nlohmann::json of_any_size = nlohmann::json::parse(note);
  for (nlohmann::json& each : of_any_size["files"]) each["bytes"] = nullptr;
  ASSERT_TRUE(WriteFile(folder / "run.json", of_any_size.dump()).has_value());
  const nlohmann::json sound = nlohmann::json::parse(whole);
  ASSERT_GE(sound["stills"].size(), 2U);
  const int begin = sound["stills"][0];
  for (const nlohmann::json& stills :
       {nlohmann::json{begin, begin}, nlohmann::json{begin + (std::int64_t{1} << 32U)},
        nlohmann::json{-1}, nlohmann::json{"a"}}) {
    nlohmann::json edited = sound;
    edited["stills"] = stills;
    ASSERT_TRUE(WriteFile(folder / "record/record.json", edited.dump()).has_value());
    const auto refused = WriteReportVideo(folder.path(), folder / "other.mp4");
    ASSERT_FALSE(refused.has_value()) << stills;
    EXPECT_NE(refused.error().message.find("a still is "), std::string::npos)
        << refused.error().message;
  }
  ASSERT_TRUE(WriteFile(folder / "record/record.json", whole).has_value());
  ASSERT_TRUE(WriteFile(folder / "run.json", note).has_value());
  std::filesystem::remove(still);
  const auto broken = WriteReportVideo(folder.path(), folder / "other.mp4");
  ASSERT_FALSE(broken.has_value());
  EXPECT_EQ(broken.error().kind, ErrorKind::kData);
  EXPECT_FALSE(std::filesystem::exists(folder / "other.mp4"));
}

// As in others' sets: models of the objects, none of the room.
class SourceWithoutBackground : public test::BoxSource {
 public:
  using BoxSource::BoxSource;
  Expected<std::vector<TrueModel>> Truth() override {
    TSDFPP_ASSIGN(std::vector<TrueModel> models, BoxSource::Truth());
    models.erase(models.begin());
    return models;
  }
};

// Heights in the world, z, of a recorded mesh.
std::vector<float> HeightsOf(const Recording& record, const json& chunk) {
  const auto slice = [&](const char* name) {
    return record.bytes.substr(chunk[name][0].get<std::size_t>(),
                               chunk[name][1].get<std::size_t>());
  };
  const json& grid = chunk.contains("grid") ? chunk["grid"] : record.json["grid"];
  std::vector<float> heights_m;
  for (const PackedVertex& vertex :
       Unpack(slice("vertex_bytes"), chunk["vertices"].get<std::size_t>(), slice("index_bytes"),
              chunk["triangles"].get<std::size_t>())
           .vertices) {
    heights_m.push_back(grid["origin_m"][2].get<float>() +
                        grid["step_m"].get<float>() * static_cast<float>(vertex.position[2]));
  }
  return heights_m;
}

// The wall lies half a metre behind what a grid around the first object holds, and so does that
// object, where it stands.
TEST(RecordedComparison, WithoutATrueBackgroundTheMapStaysWhereItIs) {
  const TempFolder folder;
  SourceWithoutBackground source(7);
  CompareConfig config;
  config.methods = {Method::kTsdfpp};
  config.profiles = {"close"};
  config.map.voxel_m = 0.03;
  config.every = 4;
  config.record = true;
  const auto result = RunCompare(source, config, folder.path(), "the command", {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  const auto recording = ReadRecording(folder.path());
  ASSERT_TRUE(recording.has_value()) << recording.error().message;
  const Recording& record = recording->value();
  constexpr float kWall_m = 1.5F;
  int on_wall = 0;
  int vertices = 0;
  for (const json& key : record.json["runs"][0]["key_frames"]) {
    for (const json& chunk : key["chunks"]) {
      if (chunk["id"] != kBackground) continue;
      for (const float z_m : HeightsOf(record, chunk)) {
        ++vertices;
        on_wall += static_cast<int>(std::abs(z_m - kWall_m) < config.map.voxel_m);
      }
    }
  }
  EXPECT_GT(vertices, 100);
  EXPECT_GT(on_wall, 0.9 * vertices);  // the rest is at the boxes' outlines
  const json& left = record.json["truth"][0];
  ASSERT_EQ(left["id"], 3);
  const std::vector<float> heights_m = HeightsOf(record, left);
  const auto [nearest, farthest] = std::minmax_element(heights_m.begin(), heights_m.end());
  constexpr float kMiddle_m = 1.2F;
  EXPECT_NEAR((*nearest + *farthest) / 2, kMiddle_m, 1e-3);
}

TEST(ReportVideo, ACutFileIsNone) {
  const auto box = [](const std::string& name, std::size_t bytes, std::size_t length) {
    std::string text;
    for (const int shift : {24, 16, 8, 0}) text += static_cast<char>(length >> shift & 255U);
    return text + name + std::string(bytes, 'x');
  };
  const std::string head = box("ftyp", 24, 32);
  const std::string body = box("mdat", 100, 108);
  const std::string index = box("moov", 50, 58);
  EXPECT_TRUE(IsWholeVideo(head + body + index));
  EXPECT_FALSE(IsWholeVideo(""));
  EXPECT_FALSE(IsWholeVideo(head + body));
  EXPECT_FALSE(IsWholeVideo(head + box("mdat", 100, 0)));  // its length was never filled in
  EXPECT_FALSE(IsWholeVideo((head + body + index).substr(0, head.size() + body.size() + 30)));
  EXPECT_FALSE(IsWholeVideo((head + body + index).substr(0, head.size() + body.size() + 4)));
  EXPECT_FALSE(IsWholeVideo(head + box("mdat", 100, 7) + index));
  EXPECT_FALSE(
      IsWholeVideo(head + box("mdat", 100, 1) + index));  // a length of eight bytes: "xxxx"
  const std::string wide = std::string("\0\0\0\x01mdat\0\0\0\0\0\0\0\x14", 16) + "1234";
  EXPECT_TRUE(IsWholeVideo(head + wide + index));
}

}  // namespace
}  // namespace tsdfpp
