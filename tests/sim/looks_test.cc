// What a scene varies of the looks: textures, paint, lamps, the room. Defaults are those of
// toycar3.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "core/toml_reader.h"
#include "sim/config/light_rig.h"
#include "sim/models/room_model.h"
#include "sim/models/textures.h"
#include "tests/sim/mesh_checks.h"
#include "tests/sim/model_stage.h"

namespace tsdfpp {
namespace {

double Difference(const TextureImage& image, int x0, int y0, int x1, int y1) {
  const auto at = [&](int x, int y) {
    return &image.pixels[3 * static_cast<std::size_t>(y * image.width + x)];
  };
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += std::abs(at(x0, y0)[k] - at(x1, y1)[k]);
  return sum / 3;
}

TEST(Textures, EveryPatternIsSeamlessAndShowsBothColours) {
  for (const std::string& pattern : TexturePatternNames()) {
    SCOPED_TRACE(pattern);
    TextureSpec spec;
    spec.pattern = pattern;
    spec.first = {200, 180, 160};
    spec.second = {40, 50, 60};
    const auto image = MakeTexture(spec);
    ASSERT_TRUE(image.has_value());
    EXPECT_EQ(image->width, 256);
    ASSERT_EQ(image->pixels.size(), 3U * 256 * 256);
    int low = 255;
    int high = 0;
    for (const std::uint8_t value : image->pixels) {
      low = std::min<int>(low, value);
      high = std::max<int>(high, value);
    }
    EXPECT_GT(high - low, 50);
    // Columns that meet when the picture repeats differ no more than columns within it do, on
    // average.
    double across = 0;
    double down = 0;
    double across_within = 0;
    double down_within = 0;
    int steps = 0;
    for (int i = 0; i < 256; ++i) {
      across += Difference(*image, 255, i, 0, i) / 256;
      down += Difference(*image, i, 255, i, 0) / 256;
    }
    double most_across = 0;
    double most_down = 0;
    for (int j = 0; j + 1 < 256; ++j) {
      across_within = down_within = 0;
      for (int i = 0; i < 256; ++i) {
        across_within += Difference(*image, j, i, j + 1, i) / 256;
        down_within += Difference(*image, i, j, i, j + 1) / 256;
      }
      most_across = std::max(most_across, across_within);
      most_down = std::max(most_down, down_within);
      ++steps;
    }
    constexpr double kSlack = 1.0;  // of 255
    EXPECT_LE(across, most_across + kSlack);
    EXPECT_LE(down, most_down + kSlack);
  }
}

TEST(Textures, DependOnTheirSpecAlone) {
  TextureSpec spec;
  spec.pattern = "marble";
  const TextureImage one = MakeTexture(spec).value();
  EXPECT_EQ(one.pixels, MakeTexture(spec).value().pixels);
  std::set<std::string> names{one.material};
  const auto expect_another = [&](const TextureSpec& other) {
    EXPECT_TRUE(names.insert(MakeTexture(other).value().material).second);
  };
  TextureSpec other = spec;
  other.seed = 8;
  EXPECT_NE(MakeTexture(other).value().pixels, one.pixels);
  expect_another(other);
  other = spec;
  other.size_m = 0.21;
  expect_another(other);
  other = spec;
  other.second[2] += 1;
  expect_another(other);
  other = spec;
  other.side_px = 128;
  expect_another(other);
  other = spec;
  other.pattern = "noise";
  expect_another(other);
}

TEST(Textures, WrongSpecsAreNamed) {
  const auto message = [](const TextureSpec& spec) {
    const auto image = MakeTexture(spec);
    EXPECT_FALSE(image.has_value());
    EXPECT_EQ(image.error().kind, ErrorKind::kUsage);
    return image.error().message;
  };
  TextureSpec spec;
  spec.pattern = "tartan";
  EXPECT_EQ(message(spec).rfind("there is no pattern 'tartan', expected one of checker, ", 0), 0U);
  spec.pattern = "checker";
  spec.size_m = 0;
  EXPECT_EQ(message(spec), "a texture's size_m is 0, expected a positive number of metres");
  spec.size_m = 1;
  spec.side_px = 4096;
  EXPECT_EQ(message(spec), "a texture's side_px is 4096, expected 16 to 2048");
}

TEST(Textures, DrawnOnesVaryAndCanBeTold) {
  std::set<std::string> patterns;
  std::set<Colour> paints;
  for (std::uint64_t i = 0; i < 200; ++i) {
    const TextureSpec spec = DrawTexture(5, i);
    patterns.insert(spec.pattern);
    const auto light = [](const Colour& c) { return 0.3 * c[0] + 0.59 * c[1] + 0.11 * c[2]; };
    EXPECT_GT(std::abs(light(spec.first) - light(spec.second)), 40);
    EXPECT_GE(spec.size_m, 0.05);
    EXPECT_LE(spec.size_m, 0.30);
    const Colour paint = DrawPaint(5, i);
    paints.insert(paint);
    const int brightest = std::max({paint[0], paint[1], paint[2]});
    EXPECT_GE(brightest, 0.45 * 255 - 1);
    EXPECT_LT(std::min({paint[0], paint[1], paint[2]}), 200);
    EXPECT_EQ(paint, DrawPaint(5, i));
    EXPECT_EQ(spec.seed, DrawTexture(5, i).seed);
  }
  EXPECT_EQ(patterns.size(), TexturePatternNames().size());
  EXPECT_GT(paints.size(), 190U);
}

// The figures that toycar3's published pictures were lit with.
TEST(Lights, TheDefaultIsToycar3s) {
  const std::unique_ptr<mjSpec, MujocoDeleter> spec(mj_makeSpec());
  AddLights(spec.get(), DefaultLightRig());
  EXPECT_EQ(spec->visual.headlight.ambient[0], 0.34F);
  EXPECT_EQ(spec->visual.headlight.diffuse[1], 0.0F);
  const std::unique_ptr<mjModel, MujocoDeleter> model(mj_compile(spec.get(), nullptr));
  ASSERT_NE(model, nullptr);
  ASSERT_EQ(model->nlight, 2);
  EXPECT_EQ(model->light_type[0], mjLIGHT_SPOT);
  EXPECT_EQ(model->light_type[1], mjLIGHT_DIRECTIONAL);
  EXPECT_EQ(model->light_castshadow[0], 1);
  EXPECT_EQ(model->light_castshadow[1], 0);
  EXPECT_EQ(model->light_diffuse[0], 0.85F);
  EXPECT_EQ(model->light_diffuse[3], 0.42F);
  EXPECT_EQ(model->light_specular[0], 0.4F);
  EXPECT_EQ(model->light_specular[3], 0.0F);
  EXPECT_EQ(model->light_cutoff[0], 55.0F);
  EXPECT_EQ(model->light_exponent[0], 4.0F);
  const Eigen::Vector3d direction = Eigen::Vector3d(1.4, -0.5, -1.8).normalized();
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(model->light_dir[k], direction[k], 1e-15);
  EXPECT_EQ(model->light_pos[0], -1.3);
  EXPECT_EQ(model->light_pos[5], 2.4);
}

TEST(Lights, TomlRoundTripIsExact) {
  LightRig rig = DrawLightRig({}, 3);
  rig.lights.push_back(DefaultLightRig().lights[0]);
  const auto again = ReadLightRig(rig.ToToml(), "memory", "lights");
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(again->ambient, rig.ambient);
  ASSERT_EQ(again->lights.size(), rig.lights.size());
  for (std::size_t i = 0; i < rig.lights.size(); ++i) {
    const SceneLight& a = rig.lights[i];
    const SceneLight& b = again->lights[i];
    EXPECT_EQ(a.kind, b.kind);
    EXPECT_EQ(a.position_W, b.position_W);
    EXPECT_EQ(a.target_W, b.target_W);
    EXPECT_EQ(a.colour, b.colour);
    EXPECT_EQ(a.gloss, b.gloss);
    EXPECT_EQ(a.cutoff_deg, b.cutoff_deg);
    EXPECT_EQ(a.exponent, b.exponent);
    EXPECT_EQ(a.shadow, b.shadow);
  }
  const auto none = ReadLightRig(toml::table{{"ambient", 0.5}}, "memory", "lights");
  ASSERT_TRUE(none.has_value());
  EXPECT_EQ(none->ambient, 0.5);
  EXPECT_EQ(none->lights.size(), 2U);
}

TEST(Lights, WrongOnesAreNamed) {
  const auto message = [](const std::string& text) {
    const auto table = ParseToml(text, "x.toml");
    EXPECT_TRUE(table.has_value());
    const auto rig = ReadLightRig(*table, "x.toml", "lights");
    EXPECT_FALSE(rig.has_value()) << text;
    if (rig.has_value()) return std::string();
    EXPECT_EQ(rig.error().kind, ErrorKind::kUsage);
    return rig.error().message;
  };
  const auto has = [&](const std::string& text, const std::string& words) {
    const std::string all = message(text);
    EXPECT_NE(all.find(words), std::string::npos) << all;
  };
  has("ambient = 2", "x.toml: lights.ambient is 2, expected 0 to 1");
  has("dim = 2", "dim");
  has("[[light]]\nkind = 'lamp'\nposition = [0, 0, 2]", "is 'lamp', expected spot or directional");
  has("[[light]]\nkind = 'spot'", "position");
  has("[[light]]\nposition = [0, 0, 2]\ntarget = [0, 0, 2]",
      "light[0].target is the light's own position");
  has("[[light]]\nposition = [0, 0, nan]", "lights.light[0].position");
  has("[[light]]\nposition = [0, 0, 2]\ncolour = [0, 0, 3]",
      "light[0].colour has 3, expected 0 to 1");
  has("[[light]]\nposition = [0, 0, 2]\ncutoff_deg = 120", "light[0].cutoff_deg is 120");
  has("[[light]]\nposition = [0, 0, 2]\nexponent = -1", "light[0].exponent is -1");
  has("[[light]]\nposition = [0, 0, 2]\ngloss = 9", "light[0].gloss is 9");
  std::string many;
  for (int i = 0; i < 8; ++i) many += "[[light]]\nposition = [0, 0, 2]\n";
  has(many, "light is there 8 times, expected 7 at most");
}

TEST(Lights, DrawnRigsAreValidAndVary) {
  LightRanges ranges;
  ranges.most_lights = 5;
  ASSERT_TRUE(ranges.Validate().has_value());
  std::set<std::size_t> counts;
  std::set<double> ambients;
  int shadows = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const LightRig rig = DrawLightRig(ranges, seed);
    ASSERT_TRUE(rig.Validate().has_value()) << rig.Validate().error().message;
    counts.insert(rig.lights.size());
    ambients.insert(rig.ambient);
    shadows += rig.lights[0].shadow ? 1 : 0;
    EXPECT_GE(rig.ambient, ranges.ambient[0]);
    EXPECT_LE(rig.ambient, ranges.ambient[1]);
    for (const SceneLight& light : rig.lights) {
      const Eigen::Vector3d from = light.position_W - ranges.target_W;
      EXPECT_GE(from.head<2>().norm(), ranges.distance_m[0] - 1e-12);
      EXPECT_LE(from.head<2>().norm(), ranges.distance_m[1] + 1e-12);
      EXPECT_GE(from.z(), ranges.height_m[0]);
      EXPECT_LE(from.z(), ranges.height_m[1]);
    }
  }
  EXPECT_EQ(counts, (std::set<std::size_t>{1, 2, 3, 4, 5}));
  EXPECT_EQ(ambients.size(), 200U);
  EXPECT_NEAR(shadows / 200.0, ranges.shadow_share, 0.1);
  ranges.ambient = {0.5, 0.2};
  EXPECT_EQ(ranges.Validate().error().message,
            "ambient is 0.5 to 0.2, expected a range within 0 to 1");
  ranges = {};
  ranges.most_lights = 9;
  EXPECT_FALSE(ranges.Validate().has_value());
}

// Each kind lights the table, and a shadow falls where it is cast.
TEST(RenderingLooks, LampsLightAndCastShadows) {
  ModelSpec ball;
  ball.name = "sphere";
  ball.scale = 2;
  const auto red_of = [&](const LightRig& rig) {
    ModelStage stage({ball}, 0, 160, 120, {}, rig);
    EXPECT_EQ(stage.error, "");
    cv::Mat red;
    cv::extractChannel(stage.Render(-90, 0.6, 0.6, 0, true).colour, red, 0);
    return red;
  };
  const LightRig dark;
  const cv::Mat ambient_only = red_of(dark);
  for (const LightKind kind : {LightKind::kSpot, LightKind::kDirectional}) {
    SceneLight light;
    light.kind = kind;
    light.position_W = {0.4, 0.3, 2.3};
    light.target_W = {0, 0, 0.74};
    light.shadow = false;
    // So weak that nothing is as white as can be.
    light.colour = {0.35, 0.35, 0.35};
    light.gloss = 0;
    LightRig rig = dark;
    rig.lights.push_back(light);
    const cv::Mat lit = red_of(rig);
    EXPECT_GT(cv::mean(lit)[0], cv::mean(ambient_only)[0] + 20) << static_cast<int>(kind);
    rig.lights[0].shadow = true;
    const cv::Mat shadowed = red_of(rig);
    constexpr int kDarker = 25;        // of 255
    constexpr int kLeastPixels = 150;  // of the 19200; the ball covers ten times as many
    EXPECT_GT(cv::countNonZero(lit - shadowed > kDarker), kLeastPixels) << static_cast<int>(kind);
  }
}

TEST(Room, EveryRoomIsClosedAndKeepsItsDefault) {
  const std::vector<ModelPart> plain = MakeRoom();
  RoomSpec spec;
  for (const bool table : {true, false}) {
    for (const bool furniture : {true, false}) {
      for (const double more : {0.0, 0.7}) {
        spec.table = table;
        spec.furniture = furniture;
        spec.half_x = kRoomHalfX_m + more;
        spec.half_y = kRoomHalfY_m + more;
        spec.height = kRoomHeight_m + more;
        ASSERT_TRUE(spec.Validate().has_value()) << spec.Validate().error().message;
        const std::vector<ModelPart> parts = MakeRoom(spec);
        const double x = spec.ground_half_x() - 0.01;
        const double y = spec.ground_half_y() - 0.01;
        for (const ModelPart& part : parts) {
          EXPECT_EQ(CountOpenEdges(part.shape), 0U) << part.name;
          EXPECT_GT(EnclosedVolume(part.shape), 0) << part.name;
          // Nothing of the room stands where objects may.
          for (const Eigen::Vector3d& p :
               {Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d(x, y, 0.1), Eigen::Vector3d(-x, y, 0.1),
                Eigen::Vector3d(x, -y, 0.1), Eigen::Vector3d(0, y, 0.1),
                Eigen::Vector3d(-x, 0, 0.1), Eigen::Vector3d(x, 0, 0.1)}) {
            const Eigen::Vector3d above = p + Eigen::Vector3d(0, 0, spec.ground_m());
            EXPECT_NEAR(WindingNumber(part.shape, above), 0, 1e-9) << part.name;
          }
        }
        if (table && furniture && more == 0) {
          EXPECT_EQ(parts.size(), plain.size());
        }
      }
    }
  }
  spec = {};
  spec.half_x = 1;
  EXPECT_NE(spec.Validate().error().message.find("expected 2.4, 2.2 and 2.6 at least"),
            std::string::npos);
  spec.half_x = 5;
  EXPECT_NE(spec.Validate().error().message.find("the room's diagonal is 11.2"), std::string::npos)
      << spec.Validate().error().message;
  spec = {};
  spec.floor_texture = TextureSpec{};
  spec.floor_texture->pattern = "grass";
  EXPECT_EQ(spec.Validate().error().message.rfind("floor_texture: there is no pattern 'grass'", 0),
            0U);
}

TEST(Room, TexturesReplaceTheRoomsOwn) {
  RoomSpec spec;
  spec.table_texture = DrawTexture(1, 1);
  spec.wall_texture = DrawTexture(1, 2);
  int covered = 0;
  for (const ModelPart& part : MakeRoom(spec)) {
    const bool own = part.name == "table_top" || part.name.rfind("wall_", 0) == 0;
    EXPECT_EQ(part.picture != nullptr, own) << part.name;
    if (part.picture) {
      EXPECT_EQ(part.material, part.picture->material);
    }
    covered += own ? 1 : 0;
  }
  EXPECT_EQ(covered, 5);
}

}  // namespace
}  // namespace tsdfpp
