// Every model of the catalogue: closed, outward, of its stated size, standing on the ground; and
// what a scene may vary of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "core/random.h"
#include "sim/models/model_catalogue.h"
#include "tests/sim/mesh_checks.h"

namespace tsdfpp {
namespace {

std::vector<ModelPart> Make(const ModelSpec& spec) {
  auto parts = MakeModel(spec);
  EXPECT_TRUE(parts.has_value()) << parts.error().message;
  return parts.has_value() ? std::move(*parts) : std::vector<ModelPart>{};
}

std::vector<ModelPart> Make(const std::string& name) {
  ModelSpec spec;
  spec.name = name;
  return Make(spec);
}

ModelSpec Named(const std::string& name) {
  ModelSpec spec;
  spec.name = name;
  return spec;
}

const ModelPart& PartNamed(const std::vector<ModelPart>& parts, const std::string& name) {
  for (const ModelPart& part : parts) {
    if (part.name == name) return part;
  }
  ADD_FAILURE() << "no part " << name;
  return parts.front();
}

TEST(Models, EveryPartIsClosedOutwardAndSound) {
  for (const ModelInfo& info : ModelCatalogue()) {
    for (const ModelPart& part : Make(info.name)) {
      SCOPED_TRACE(info.name + " " + part.name);
      EXPECT_EQ(CountOpenEdges(part.shape), 0U);
      EXPECT_GT(EnclosedVolume(part.shape), 0);
      EXPECT_EQ(part.region, info.name);
      std::set<std::uint32_t> used;
      // The renderer has single precision: of a metre-sized model a tenth of a micrometre.
      constexpr double kLeastEdge_m = 2e-6;
      constexpr double kLeastArea_m2 = 1e-11;
      double least_edge = 1;
      double least_area = 1;
      for (const auto& triangle : part.shape.triangles) {
        std::array<Eigen::Vector3d, 3> p;
        for (std::size_t k = 0; k < 3; ++k) {
          ASSERT_LT(triangle[k], part.shape.vertices.size());
          p[k] = part.shape.vertices[triangle[k]];
          ASSERT_TRUE(p[k].allFinite());
          used.insert(triangle[k]);
        }
        for (std::size_t k = 0; k < 3; ++k) {
          least_edge = std::min(least_edge, (p[k] - p[(k + 1) % 3]).norm());
        }
        least_area = std::min(least_area, (p[1] - p[0]).cross(p[2] - p[0]).norm() / 2);
      }
      EXPECT_GT(least_edge, kLeastEdge_m);
      EXPECT_GT(least_area, kLeastArea_m2);
      EXPECT_EQ(used.size(), part.shape.vertices.size()) << "a vertex of no face";
    }
  }
}

TEST(Models, StandOnTheGroundWithTheSizeTheyState) {
  std::size_t most = 0;
  for (const ModelInfo& info : ModelCatalogue()) {
    SCOPED_TRACE(info.name);
    const std::vector<ModelPart> parts = Make(info.name);
    std::size_t triangles = 0;
    std::set<std::string> names;
    for (const ModelPart& part : parts) {
      triangles += part.shape.triangles.size();
      EXPECT_TRUE(names.insert(part.name).second) << part.name;
    }
    EXPECT_LE(triangles, kMaxModelTriangles);
    most = std::max(most, triangles);
    const Eigen::AlignedBox3d box = BoundsOf(parts);
    EXPECT_NEAR(box.min().z(), kToyClearance_m, 1e-4);
    EXPECT_LT((box.sizes() - info.size_m).cwiseAbs().maxCoeff(), kModelSizeTolerance_m)
        << box.sizes().transpose() << " of " << triangles << " triangles";
    // Above the origin: an object's place is where it stands.
    constexpr double kOffMiddle = 0.2;  // share of the size; toys have a front
    EXPECT_LT(std::abs(box.center().x()), kOffMiddle * box.sizes().x());
    EXPECT_LT(std::abs(box.center().y()), kOffMiddle * box.sizes().y());
  }
  EXPECT_GT(most, kMaxModelTriangles / 3) << "the budget says nothing";
}

// Not one of them, seen along any axis at any place of its middle region, is thinner than 2.5 cm
// unless it says so: the thinnest extent of any part.
TEST(Models, ThinOnesSaySo) {
  constexpr double kThin_m = 0.025;
  for (const ModelInfo& info : ModelCatalogue()) {
    double thinnest = 1;
    std::string which;
    for (const ModelPart& part : Make(info.name)) {
      const double least = BoxAround(part.shape).sizes().minCoeff();
      if (least < thinnest) which = part.name;
      thinnest = std::min(thinnest, least);
    }
    // Eyes, wings and bills are parts of something thick.
    if (info.name == "duck" || info.name == "rocking_horse" || info.name == "ship") continue;
    if (info.thin || info.hollow) continue;
    EXPECT_GE(thinnest, kThin_m) << info.name << " " << which;
  }
  for (const char* name : {"card", "plate", "cup", "book", "domino"}) {
    EXPECT_TRUE(FindModel(name)->thin) << name;
  }
}

// A point in a hollow model's room is in none of its parts, and points in its walls are.
TEST(Models, HollowOnesAreHollow) {
  struct Probe {
    const char* model;
    Eigen::Vector3d empty;
    Eigen::Vector3d filled;
  };
  const std::vector<Probe> probes{
      {"cup", {0, 0, 0.05}, {0, 0, 0.003}},          {"cover", {0, 0, 0.05}, {0, 0, 0.102}},
      {"bowl", {0, 0, 0.04}, {0, 0, 0.006}},         {"crate", {0.1, 0.05, 0.06}, {0, 0, 0.006}},
      {"tray", {0.1, 0.05, 0.016}, {0.1, 0, 0.003}}, {"garage", {0, 0, 0.075}, {0, 0.116, 0.08}},
      {"arch", {0, 0, 0.05}, {0.08, 0, 0.05}},       {"torus", {0, 0, 0.022}, {0.06, 0, 0.022}},
      {"mug", {0, 0, 0.08}, {0.046, 0, 0.08}},       {"plate", {0.05, 0, 0.009}, {0.05, 0, 0.004}},
      {"rocking_horse", {0, 0, 0.08}, {0, 0, 0.17}}};
  for (const Probe& probe : probes) {
    double empty = 0;
    double filled = 0;
    for (const ModelPart& part : Make(probe.model)) {
      empty += std::abs(WindingNumber(part.shape, probe.empty));
      filled = std::max(filled, WindingNumber(part.shape, probe.filled));
    }
    EXPECT_NEAR(empty, 0, 1e-9) << probe.model;
    EXPECT_NEAR(filled, 1, 1e-9) << probe.model;
    EXPECT_TRUE(FindModel(probe.model)->hollow) << probe.model;
  }
}

// The fit that scenes rely on: the ball under the cover, the car in the garage and in the crate.
TEST(Models, FitIntoOneAnother) {
  const auto expect_free = [](const std::string& outer, const std::vector<ModelPart>& inner,
                              const Eigen::Vector3d& at) {
    const std::vector<ModelPart> around = Make(outer);
    std::size_t inside = 0;
    for (const ModelPart& part : inner) {
      for (std::size_t i = 0; i < part.shape.vertices.size(); i += 7) {
        for (const ModelPart& wall : around) {
          inside += WindingNumber(wall.shape, part.shape.vertices[i] + at) > 0.5 ? 1 : 0;
        }
      }
    }
    EXPECT_EQ(inside, 0U) << outer;
  };
  expect_free("cover", Make("sphere"), {0, 0, 0});
  expect_free("garage", Make("car"), {0.01, 0, 0});
  expect_free("crate", Make("car"), {0, 0, 0.014});
  expect_free("tray", Make("cover"), {0, 0, 0.008});
}

TEST(Models, TheToysKeepTheirBytes) {
  for (const std::string& name : ToyModelNames()) {
    const std::vector<ModelPart> toy = MakeToy(name);
    const std::vector<ModelPart> model = Make(name);
    ASSERT_EQ(toy.size(), model.size());
    for (std::size_t i = 0; i < toy.size(); ++i) {
      EXPECT_EQ(toy[i].name, model[i].name);
      EXPECT_EQ(toy[i].colour, model[i].colour);
      EXPECT_EQ(toy[i].shape.triangles, model[i].shape.triangles);
      ASSERT_EQ(toy[i].shape.vertices.size(), model[i].shape.vertices.size());
      EXPECT_EQ(std::memcmp(toy[i].shape.vertices.data(), model[i].shape.vertices.data(),
                            toy[i].shape.vertices.size() * sizeof(Eigen::Vector3d)),
                0);
    }
  }
}

TEST(Models, SolidsHaveAnySizeAndTheirVolume) {
  const Eigen::Vector3d size(0.2, 0.1, 0.14);
  const double box = size.prod();
  // Share of the bounding box that the ideal shape fills; bevels and facets take a little.
  const std::vector<std::pair<std::string, double>> shares{
      {"cube", 1.0},       {"brick", 1.0},       {"cylinder", M_PI / 4}, {"sphere", M_PI / 6},
      {"cone", M_PI / 12}, {"pyramid", 1.0 / 3}, {"hexagon", 0.75},      {"wedge", (1 + 0.12) / 2}};
  constexpr double kBevelAndFacets = 0.045;
  for (const auto& [name, share] : shares) {
    ModelSpec spec = Named(name);
    spec.size_m = size;
    const std::vector<ModelPart> parts = Make(spec);
    EXPECT_NEAR(EnclosedVolume(parts.front().shape) / box, share, kBevelAndFacets) << name;
    EXPECT_LT((BoundsOf(parts).sizes() - size).cwiseAbs().maxCoeff(), 1e-4) << name;
  }
  ModelSpec round = Named("capsule");
  round.size_m = Eigen::Vector3d(0.1, 0.1, 0.3);
  const double capsule = M_PI * 0.05 * 0.05 * 0.2 + 4 * M_PI / 3 * 0.05 * 0.05 * 0.05;
  EXPECT_NEAR(EnclosedVolume(Make(round).front().shape) / capsule, 1, 0.01);
}

TEST(Models, SolidsOfExtremeSizesAreSound) {
  for (const ModelInfo& info : ModelCatalogue()) {
    if (!info.solid) continue;
    for (const Eigen::Vector3d& size :
         {Eigen::Vector3d(0.3, 0.02, 0.005), Eigen::Vector3d(0.004, 0.1, 0.3),
          Eigen::Vector3d(0.05, 0.05, 0.05), Eigen::Vector3d(2, 2, 0.01)}) {
      ModelSpec spec = Named(info.name);
      spec.size_m = size;
      const std::vector<ModelPart> parts = Make(spec);
      SCOPED_TRACE(info.name);
      EXPECT_EQ(CountOpenEdges(parts.front().shape), 0U);
      EXPECT_GT(EnclosedVolume(parts.front().shape), 0);
      EXPECT_LT((BoundsOf(parts).sizes() - size).cwiseAbs().maxCoeff(), 0.05 * size.maxCoeff());
    }
  }
}

TEST(Models, ScaleGrowsAllButTheClearance) {
  for (const char* name : {"duck", "car", "brick"}) {
    ModelSpec spec = Named(name);
    spec.scale = 1.7;
    const Eigen::AlignedBox3d one = BoundsOf(Make(name));
    const Eigen::AlignedBox3d more = BoundsOf(Make(spec));
    EXPECT_LT((more.sizes() - 1.7 * one.sizes()).norm(), 1e-12) << name;
    EXPECT_NEAR(more.min().z(), kToyClearance_m, 1e-4) << name;
  }
}

TEST(Models, PaintAndMaterialReachTheMainPart) {
  ModelSpec spec = Named("truck");
  spec.paint = Colour{1, 2, 3};
  std::vector<ModelPart> parts = Make(spec);
  EXPECT_EQ(PartNamed(parts, "cabin").colour, (Colour{1, 2, 3}));
  EXPECT_EQ(PartNamed(parts, "cargo").colour, PartNamed(MakeToy("truck"), "cargo").colour);
  spec.material = "marble";
  parts = Make(spec);
  ASSERT_NE(PartNamed(parts, "cabin").picture, nullptr);
  EXPECT_EQ(PartNamed(parts, "cabin").material, PartNamed(parts, "cabin").picture->material);
  EXPECT_EQ(PartNamed(parts, "cabin").colour, PartNamed(parts, "cabin").picture->mean);
  EXPECT_EQ(PartNamed(parts, "cargo").picture, nullptr);
  // Paint alone takes a picture away.
  ModelSpec crate = Named("crate");
  EXPECT_NE(Make(crate).front().picture, nullptr);
  crate.paint = Colour{9, 9, 9};
  EXPECT_EQ(Make(crate).front().picture, nullptr);
  EXPECT_EQ(Make(crate).front().material, "");
}

TEST(Models, WrongSpecsAreNamed) {
  const auto expect = [](const ModelSpec& spec, const std::string& words) {
    for (const Expected<void>& status : {CheckModelSpec(spec), [&]() -> Expected<void> {
                                           auto parts = MakeModel(spec);
                                           if (!parts) return tl::unexpected(parts.error());
                                           return {};
                                         }()}) {
      ASSERT_FALSE(status.has_value()) << words;
      EXPECT_EQ(status.error().kind, ErrorKind::kUsage);
      EXPECT_NE(status.error().message.find(words), std::string::npos) << status.error().message;
    }
  };
  expect(Named("elephant"), "there is no model 'elephant', expected one of truck, car,");
  expect(Named("mesh"), "model 'mesh' names no file");
  ModelSpec spec = Named("car");
  spec.scale = 0;
  expect(spec, "scale of model 'car' is 0, expected 1e-06 to 1000000");
  spec.scale = std::nan("");
  expect(spec, "scale of model 'car' is nan");
  spec.scale = 100;
  expect(spec, "model 'car' is 27.1 m long at scale 100, expected 0.001 to 10 m");
  spec = Named("car");
  spec.size_m = Eigen::Vector3d(1, 1, 1);
  expect(spec, "model 'car' has a size, which only solids have (cube, brick,");
  spec = Named("cube");
  spec.size_m = Eigen::Vector3d(1, -1, 1);
  expect(spec, "size of model 'cube' has -1 m, expected 0.001 to 10");
  spec = Named("cube");
  spec.material = "gold";
  expect(spec, "material of model 'cube' is 'gold', expected one of checker,");
  spec = Named("cube");
  spec.file = "x.obj";
  expect(spec, "model 'cube' has a file, x.obj, which only 'mesh' reads");
  spec = Named("cube");
  spec.picture = "x.png";
  expect(spec, "model 'cube' has a picture");
  spec = Named("cube");
  spec.up = "y";
  expect(spec, "model 'cube' has up");
  spec = Named("mesh");
  spec.file = "x.obj";
  spec.up = "w";
  expect(spec, "up of model 'mesh' is 'w', expected x, y, z, -x, -y or -z");
}

}  // namespace
}  // namespace tsdfpp
