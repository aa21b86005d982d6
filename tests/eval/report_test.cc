// The recording of a comparison and the page made of it: sizes, places, what the layers mean, and
// that nothing in a run can act in the page.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cmath>
#include <opencv2/videoio.hpp>
#include <set>

#include "core/files.h"
#include "eval/compare/compare.h"
#include "eval/compare/report_record.h"
#include "eval/report/recording.h"
#include "eval/report/report_page.h"
#include "eval/report/report_video.h"
#include "eval/run/open_source.h"
#include "eval/tools/base64.h"
#include "eval/tools/packed_mesh.h"
#include "metrics/mesh_tools.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"
#include "viewer/report_template.h"

namespace tsdfpp {
namespace {

using nlohmann::json;
using test::TempFolder;

// A square of n x n cells of `side` metres in the plane z = height, two triangles a cell.
TriangleMesh Sheet(int n, float side, InstanceId id) {
  TriangleMesh mesh;
  const auto at = [&](int x, int y) { return static_cast<std::uint32_t>(y * (n + 1) + x); };
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      mesh.vertices.emplace_back(side * static_cast<float>(x), side * static_cast<float>(y), 0.5F);
      mesh.colours.push_back({static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), 7});
    }
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      mesh.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      mesh.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  }
  mesh.face_ids.assign(mesh.triangles.size(), id);
  return mesh;
}

struct Unpacked {
  std::vector<PackedVertex> vertices;
  std::vector<std::uint32_t> indices;
};

Unpacked Unpack(const std::string& vertex_bytes, std::size_t vertices,
                const std::string& index_bytes, std::size_t triangles) {
  Unpacked out{std::vector<PackedVertex>(vertices), std::vector<std::uint32_t>(3 * triangles)};
  EXPECT_EQ(meshopt_decodeVertexBuffer(out.vertices.data(), vertices, sizeof(PackedVertex),
                                       reinterpret_cast<const unsigned char*>(vertex_bytes.data()),
                                       vertex_bytes.size()),
            0);
  EXPECT_EQ(meshopt_decodeIndexBuffer(out.indices.data(), out.indices.size(), sizeof(std::uint32_t),
                                      reinterpret_cast<const unsigned char*>(index_bytes.data()),
                                      index_bytes.size()),
            0);
  return out;
}

Eigen::Vector3f PlaceOf(const PackedVertex& vertex, const Eigen::Vector3f& origin, float step_m) {
  return origin +
         step_m * Eigen::Vector3f(vertex.position[0], vertex.position[1], vertex.position[2]);
}

double AreaOf(const Unpacked& mesh, const PositionGrid& grid) {
  double area = 0;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    const auto corner = [&](std::size_t k) {
      return PlaceOf(mesh.vertices[mesh.indices[i + k]], grid.origin, grid.step_m);
    };
    area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  }
  return area;
}

TEST(PackedMesh, ComesBackWithinHalfAStepWithItsColoursAndMeasures) {
  const TriangleMesh sheet = Sheet(20, 0.037F, 3);
  const PositionGrid grid = GridAround(BoundsOf(sheet));
  VertexMeasures measures;
  for (std::size_t v = 0; v < sheet.vertices.size(); ++v) {
    measures.error.push_back(static_cast<std::uint8_t>(v % 251));
    measures.age.push_back(static_cast<std::uint8_t>(v % 17));
  }
  const PackedMesh packed = Pack(sheet, measures, grid);
  ASSERT_EQ(packed.vertices, sheet.vertices.size());
  ASSERT_EQ(packed.triangles, sheet.triangles.size());
  const Unpacked back =
      Unpack(packed.vertex_bytes, packed.vertices, packed.index_bytes, packed.triangles);
  // Vertices are in another order: the colour says which one it was.
  std::set<std::size_t> met;
  for (const PackedVertex& vertex : back.vertices) {
    const std::size_t v = vertex.colour[1] * 21U + vertex.colour[0];
    ASSERT_LT(v, sheet.vertices.size());
    met.insert(v);
    const float off =
        (PlaceOf(vertex, grid.origin, grid.step_m) - sheet.vertices[v]).cwiseAbs().maxCoeff();
    EXPECT_LE(off, 0.51F * grid.step_m);
    EXPECT_EQ(vertex.error, measures.error[v]);
    EXPECT_EQ(vertex.age, measures.age[v]);
    EXPECT_EQ(vertex.colour[2], 7);
  }
  EXPECT_EQ(met.size(), sheet.vertices.size());
  EXPECT_NEAR(AreaOf(back, grid), SurfaceArea(sheet), 1e-3 * SurfaceArea(sheet));
}

TEST(PackedMesh, DecimationKeepsTheBorderAndThePlane) {
  const TriangleMesh sheet = Sheet(40, 0.02F, 1);
  const TriangleMesh small = Decimate(sheet, 400);
  EXPECT_LE(small.triangles.size(), 400U);
  EXPECT_GE(small.triangles.size(), 2U);
  EXPECT_NEAR(SurfaceArea(small), SurfaceArea(sheet), 1e-5);
  // All 160 vertices of the border are still there, so a neighbour that was cut off still meets it.
  int on_border = 0;
  for (const Eigen::Vector3f& p : small.vertices) {
    if (p.x() == 0 || p.y() == 0 || p.x() == BoundsOf(sheet).max().x() ||
        p.y() == BoundsOf(sheet).max().y()) {
      ++on_border;
    }
  }
  EXPECT_EQ(on_border, 160);
}

TEST(PackedMesh, DecimationJoinsVerticesAndTakesTheEmptyMesh) {
  TriangleMesh soup;
  const TriangleMesh sheet = Sheet(3, 0.1F, 1);
  for (const auto& triangle : sheet.triangles) {
    const auto first = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t v : triangle) soup.vertices.push_back(sheet.vertices[v]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  EXPECT_EQ(Decimate(soup, 1000).vertices.size(), 16U);
  EXPECT_EQ(Decimate(soup, 1000).triangles.size(), 18U);
  EXPECT_TRUE(Decimate(TriangleMesh{}, 10).triangles.empty());
}

// The scene has triangles 0-5 of the table and a car; without the car triangle 5 goes and 6, 7
// come.
TEST(PackedMesh, ARemovalIsCutIntoWhatStaysGoesAndComes) {
  const TriangleMesh sheet = Sheet(2, 0.1F, 0);
  TriangleMesh scene = sheet;
  scene.triangles.resize(6);
  scene.face_ids.resize(6);
  scene.triangles.push_back(sheet.triangles[7]);
  scene.face_ids.push_back(4);  // the car, at a place where the table is
  TriangleMesh revealed = sheet;
  revealed.triangles.erase(revealed.triangles.begin() + 5);
  revealed.face_ids.pop_back();
  const RemovalLayers layers = CutByRemoval(scene, revealed, {4});
  EXPECT_EQ(layers.common.triangles.size(), 5U);
  EXPECT_EQ(layers.gone.triangles.size(), 1U);
  EXPECT_EQ(layers.revealed.triangles.size(), 2U);
  EXPECT_EQ(layers.gone.vertices.size(), 3U);  // no vertices that it does not use
}

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

TEST(Base64Text, IsThatOfTheStandard) {  // RFC 4648, section 10
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
}

// What `tsdfpp compare --record` could have written, of two key frames whose bytes are no images.
void WriteTinyRun(const std::filesystem::path& folder) {
  const json run{{"title", "tsdf, paper, given poses"},
                 {"folder", "tsdf_paper_gt"},
                 {"method", "tsdf"},
                 {"profile", "paper"},
                 {"poses", "gt"}};
  const json summary{{"schema", 1},
                     {"generator", "tsdfpp"},
                     {"version", "0.1.0"},
                     {"command", "c"},
                     {"sequence", "tiny"},
                     {"first_frame", 1},
                     {"last_frame", 16},
                     {"every", 8},
                     {"cores", 2},
                     {"read_s", 1.5},
                     {"total_s", 2.5},
                     {"removed", {1}},
                     {"reveal_frame", nullptr},
                     {"runs", {run}}};
  ASSERT_TRUE(WriteFile(folder / "summary.json", summary.dump()));
  ASSERT_TRUE(
      WriteFile(folder / "frames.csv", "frame,method,profile,poses,x\n8,tsdf,paper,gt,1\n"));
  std::string bytes;
  const auto place = [&](std::size_t length) {
    json at = json::array({bytes.size(), length});
    for (std::size_t i = 0; i < length; ++i) bytes += static_cast<char>(bytes.size() * 37 % 251);
    return at;
  };
  const auto mesh = [&](const char* layer) {
    return json{{"id", 0U},
                {"vertices", 3U},
                {"triangles", 1U},
                {"layer", layer},
                {"vertex_bytes", place(90)},
                {"index_bytes", place(10)}};
  };
  json keys = json::array();
  json run_keys = json::array();
  json frames = json::array();
  for (const int frame : {8, 16}) {
    frames.push_back({{"frame", frame}, {"T_WC", {0, 0, 0, 0, 0, 0, 1}}, {"T_WO", json::object()}});
    keys.push_back(
        {{"frame", frame}, {"colour", place(3000)}, {"depth", place(2000)}, {"mask", place(500)}});
    run_keys.push_back({{"frame", frame},
                        {"picture", place(4000)},
                        {"picture_after", place(4000)},
                        {"chunks", {mesh("common"), mesh("hole")}}});
  }
  const json record{{"schema", 1},
                    {"grid", {{"origin_m", {0, 0, 0}}, {"step_m", 0.001}}},
                    {"intrinsics", json::object()},
                    {"error_step_m", 0.0002},
                    {"age_step_frames", 1},
                    {"depth_range_m", {0.5, 3}},
                    {"objects", {{{"id", 0U}, {"name", "background"}, {"colour", {1, 2, 3}}}}},
                    {"frames", frames},
                    {"truth", {mesh("truth")}},
                    {"key_frames", keys},
                    {"runs", {{{"folder", "tsdf_paper_gt"}, {"key_frames", run_keys}}}}};
  ASSERT_TRUE(WriteFile(folder / "record" / "record.json", record.dump()));
  ASSERT_TRUE(WriteFile(folder / "record" / "record.bin", bytes));
}

std::string Text(const std::filesystem::path& file) { return ReadFile(file).value_or(""); }

class Report : public testing::Test {
 protected:
  void SetUp() override { WriteTinyRun(Run()); }
  std::filesystem::path Run() const { return folder_ / "run"; }
  std::filesystem::path Copy(const std::string& name) const {
    const std::filesystem::path copy = folder_ / name;
    std::filesystem::copy(Run(), copy, std::filesystem::copy_options::recursive);
    return copy;
  }

 private:
  TempFolder folder_;
};

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
  std::filesystem::remove(folder / "record" / "stills" / StillName("mask", 16));
  const auto broken = WriteReportVideo(folder.path(), folder / "other.mp4");
  ASSERT_FALSE(broken.has_value());
  EXPECT_EQ(broken.error().kind, ErrorKind::kData);
  EXPECT_FALSE(std::filesystem::exists(folder / "other.mp4"));
}

TEST_F(Report, MakesAPageWithItsFiguresAndNoPlaceLeft) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const auto page = MakeReportPage({Run(), Copy("second")}, "tsdfpp report run");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_LT(page->html.size(), kLargestPage_bytes);
  EXPECT_EQ(page->html.find(kReportDataMark), std::string::npos);
  EXPECT_NE(page->html.find("id=\"report-bytes-1\""), std::string::npos);
  EXPECT_EQ(page->html.find("http-equiv=\"refresh\""), std::string::npos);
}

// Key frames go, one at a time, and with them their bytes, until the page is small enough.
TEST_F(Report, APageThatIsTooLargeLeavesOutKeyFramesAndSaysSo) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const auto whole = MakeReportPage({Run()}, "c");
  ASSERT_TRUE(whole.has_value());
  const auto page = MakeReportPage({Run()}, "c", whole->html.size() - 1000);
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_LT(page->html.size(), whole->html.size() - 1000);
  ASSERT_EQ(page->remarks.size(), 1U);
  EXPECT_NE(page->remarks[0].find("key frame 8 "), std::string::npos) << page->remarks[0];
  const auto none = MakeReportPage({Run()}, "c", 1000);
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().kind, ErrorKind::kData);
}

TEST_F(Report, DroppingAKeyFrameKeepsTheBytesOfTheOthers) {
  Recording record = **ReadRecording(Run());
  const auto bytes_of = [&](const json& place) {
    return record.bytes.substr(place[0].get<std::size_t>(), place[1].get<std::size_t>());
  };
  const std::string colour = bytes_of(record.json["key_frames"][1]["colour"]);
  const std::string picture = bytes_of(record.json["runs"][0]["key_frames"][1]["picture"]);
  const std::size_t before = record.bytes.size();
  EXPECT_EQ(record.LeastKeyFrame(std::nullopt), 8);
  EXPECT_EQ(record.LeastKeyFrame(8), 16);
  record.DropKeyFrame(9);  // which there is not
  EXPECT_EQ(record.bytes.size(), before);
  record.DropKeyFrame(8);
  EXPECT_LT(record.bytes.size(), before * 3 / 4);
  EXPECT_EQ(record.KeyFrames(), std::vector<int>{16});
  EXPECT_EQ(bytes_of(record.json["key_frames"][0]["colour"]), colour);
  EXPECT_EQ(bytes_of(record.json["runs"][0]["key_frames"][0]["picture"]), picture);
}

// Numbers that wrap would never be dropped; bytes that are named over and over fill all memory.
TEST_F(Report, ARecordingNamesItsFramesAndBytesOnce) {
  const auto refused = [&](const std::string& name, const std::function<void(json&)>& spoil) {
    const std::filesystem::path run = Copy(name);
    json record = json::parse(Text(run / "record" / "record.json"));
    spoil(record);
    EXPECT_TRUE(WriteFile(run / "record" / "record.json", record.dump()));
    const auto recording = ReadRecording(run);
    return recording ? std::string() : recording.error().message;
  };
  const auto wrapped = [](json& record) { record["key_frames"][0]["frame"] = 4294967304; };
  EXPECT_NE(refused("wrapped", wrapped).find("lacks something"), std::string::npos);
  const auto negative = [](json& record) { record["frames"][0]["frame"] = -1; };
  EXPECT_NE(refused("negative", negative).find("lacks something"), std::string::npos);
  const auto twice = [&](json& record) {
    record["key_frames"][0]["colour"] = {0, Text(Run() / "record" / "record.bin").size()};
  };
  EXPECT_NE(refused("twice", twice).find("is no offset and length of its own"), std::string::npos);
  EXPECT_EQ(refused("sound", [](json&) {}), "");
}

// A name can say what it likes: between its <script> tags the data has no '<' at all.
TEST_F(Report, NothingInARunCanEndTheDataOfThePage) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const std::filesystem::path copy = Copy("<script>bad()<!--");
  json summary = json::parse(Text(copy / "summary.json"));
  summary["sequence"] = "</script><script>alert(1)</script><!--<script>";
  summary["runs"][0]["title"] = "\xff<img src=x onerror=alert(1)>";
  ASSERT_TRUE(WriteFile(copy / "summary.json",
                        summary.dump(1, ' ', false, json::error_handler_t::replace)));
  const auto page = MakeReportPage({copy}, "tsdfpp report '</script>'");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  const std::string open = "id=\"report-data\">";
  const std::size_t start = page->html.find(open) + open.size();
  const std::size_t end = page->html.find('<', start);
  EXPECT_EQ(page->html.compare(end, 9, "</script>"), 0);
  const json data = json::parse(page->html.substr(start, end - start), nullptr, false);
  ASSERT_TRUE(data.is_object()) << "the data ended early";
  EXPECT_EQ(data["reports"][0]["summary"]["sequence"], summary["sequence"]);
}

// What another run left there is not shown beside this one's.
TEST_F(Report, AnInterruptedRunGetsASentence) {
  TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
  const auto expect = [&](const std::filesystem::path& run, const std::string& words) {
    const auto page = MakeReportPage({run}, "c");
    ASSERT_FALSE(page.has_value()) << words;
    EXPECT_EQ(page.error().kind, ErrorKind::kData);
    EXPECT_NE(page.error().message.find("holds an interrupted run"), std::string::npos)
        << page.error().message;
    EXPECT_NE(page.error().message.find(words), std::string::npos) << page.error().message;
  };
  const std::filesystem::path run = Copy("named");
  json summary = json::parse(Text(run / "summary.json"));
  summary["run"] = "0123456789abcdef";
  const std::string text = summary.dump();
  ASSERT_TRUE(WriteFile(run / "summary.json", text));
  expect(run, "its run.json is missing");
  EXPECT_FALSE(WriteReportVideo(run, run / "film.mp4").has_value());
  json note{{"schema", 1}, {"command", "c"}, {"run", "0123456789abcdef"}, {"files", json::array()}};
  for (const char* file :
       {"summary.json", "frames.csv", "record/record.json", "record/record.bin"}) {
    note["files"].push_back({{"name", file}, {"bytes", Text(run / file).size()}});
  }
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  // A picture that the run does not know is left out; of an older version's run all are taken.
  ASSERT_TRUE(WriteFile(run / "table-gt.png", "another run's"));
  const auto page = MakeReportPage({run}, "c");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_EQ(page->html.find(Base64("another run's")), std::string::npos);

  ASSERT_TRUE(WriteFile(run / "frames.csv", Text(run / "frames.csv") + "\n"));
  expect(run, "frames.csv has");
  note["run"] = "fedcba9876543210";
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  expect(run, "its summary is of another run");
  note["files"][0]["name"] = "../summary.json";
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  const auto odd = MakeReportPage({run}, "c");
  ASSERT_FALSE(odd.has_value());
  EXPECT_NE(odd.error().message.find("a file lies elsewhere"), std::string::npos);
  // An older recording beside a comparison that made none.
  note["run"] = "0123456789abcdef";
  note["files"] = json::array();
  for (const char* file : {"summary.json", "frames.csv"}) {
    note["files"].push_back({{"name", file}, {"bytes", nullptr}});
  }
  ASSERT_TRUE(WriteFile(run / "run.json", note.dump()));
  expect(run, "record/record.bin is not of this run");
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

TEST_F(Report, SpoiltFilesGetASentence) {
  struct Case {
    const char* name;
    std::function<void(const std::filesystem::path&)> spoil;
    const char* says;
  };
  const auto edit = [](const std::filesystem::path& file,
                       const std::function<void(json&)>& change) {
    json value = json::parse(Text(file));
    change(value);
    ASSERT_TRUE(WriteFile(file, value.dump()));
  };
  const std::vector<Case> cases{
      {"no-summary", [](const auto& run) { std::filesystem::remove(run / "summary.json"); },
       "has no summary.json"},
      {"no-json", [](const auto& run) { (void)WriteFile(run / "summary.json", "[1"); },
       "not a JSON object"},
      {"schema",
       [&](const auto& run) { edit(run / "summary.json", [](json& s) { s["schema"] = 7; }); },
       "schema is 7, expected 1"},
      {"no-runs",
       [&](const auto& run) { edit(run / "summary.json", [](json& s) { s["runs"] = 1; }); },
       "'runs' is missing"},
      {"no-csv", [](const auto& run) { std::filesystem::remove(run / "frames.csv"); },
       "frames.csv"},
      {"csv", [](const auto& run) { (void)WriteFile(run / "frames.csv", "a,b\n"); },
       "does not begin with"},
      {"short-bytes",
       [](const auto& run) { std::filesystem::resize_file(run / "record" / "record.bin", 1000); },
       "in the 1000 bytes of record.bin"},
      {"no-bytes", [](const auto& run) { std::filesystem::remove(run / "record" / "record.bin"); },
       "record.bin"},
      {"place",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) {
           r["key_frames"][0]["mask"] = {-1, 5};
         });
       },
       "[-1,5] is no offset and length"},
      {"pose",
       [&](const auto& run) {
         edit(run / "record" / "record.json", [](json& r) { r["frames"][0]["T_WC"] = {1, 2}; });
       },
       "lacks something"},
      {"chunks",
       [&](const auto& run) {
         edit(run / "record" / "record.json",
              [](json& r) { r["runs"][0]["key_frames"][0]["chunks"] = "all"; });
       },
       "lacks something"},
  };
  for (const Case& each : cases) {
    const std::filesystem::path run = Copy(each.name);
    each.spoil(run);
    const auto page = MakeReportPage({run}, "c");
    TSDFPP_NEEDS(!ReportTemplate().empty(), "a build with the report's page");
    ASSERT_FALSE(page.has_value()) << each.name;
    EXPECT_EQ(page.error().kind, ErrorKind::kData) << each.name;
    EXPECT_NE(page.error().message.find(each.says), std::string::npos) << page.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
