// Objects that leave the view and come back elsewhere, turned, with masks whose ids are drawn anew
// in every frame: the right id comes back.
#include "mapper/associate/reentry.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <numbers>

#include "mapper/pipeline.h"
#include "tests/mapper/toy_scene.h"
#include "tests/mapper/vote_world.h"

namespace tsdfpp {
namespace {

constexpr double kVoxel_m = 0.01;
constexpr double kFrameRate_hz = 30;

// Toys of boxes and balls, that stand on z = 0 of their own frames.
void AddToy(int kind, InstanceId id, reference::Scene& scene) {
  const auto box = [&](Colour colour, const Eigen::Vector3d& centre, const Eigen::Vector3d& half) {
    scene.shapes.push_back(reference::Cuboid(id, colour, Pose(Eigen::Translation3d(centre)), half));
  };
  switch (kind) {
    case 0:  // an L
      box({190, 40, 40}, {0, 0, 0.02}, {0.07, 0.03, 0.02});
      box({190, 40, 40}, {-0.05, 0, 0.07}, {0.02, 0.03, 0.03});
      return;
    case 1:  // a ball on a box
      box({40, 150, 60}, {0, 0, 0.025}, {0.045, 0.045, 0.025});
      scene.shapes.push_back(reference::Sphere(id, {50, 60, 200}, {0.01, 0, 0.075}, 0.032));
      return;
    case 2:  // a T that lies
      box({200, 180, 40}, {0, 0, 0.02}, {0.08, 0.022, 0.02});
      box({200, 180, 40}, {0.02, 0.06, 0.02}, {0.022, 0.04, 0.02});
      return;
    default:  // steps
      box({150, 60, 170}, {0, 0, 0.015}, {0.07, 0.045, 0.015});
      box({60, 160, 170}, {0.015, 0.01, 0.045}, {0.045, 0.03, 0.015});
      box({150, 60, 170}, {0.03, 0.015, 0.08}, {0.02, 0.02, 0.02});
  }
}

constexpr int kKinds = 4;
constexpr double kToyRadius_m = 0.1;

Pose OnTable(double x, double y, double yaw_rad) {
  return reference::MakePose(yaw_rad, Eigen::Vector3d::UnitZ(), {x, y, kTableTop_m});
}

// What came of a case.
struct Outcome {
  InstanceId before = kNoInstance;  // the id that the object had
  std::optional<int> frames;        // until it had one again, from when it was there
  InstanceId after = kNoInstance;
  bool others_kept = true;  // the others have their ids at the end
};

// Three toys, one of which is gone for a while.
class Case {
 public:
  static constexpr int kSeen = 20;
  static constexpr int kBack = 18;

  explicit Case(std::uint64_t seed) : dice_(seed), ids_(seed) {
    std::vector<int> kinds{0, 1, 2, 3};
    kinds.erase(kinds.begin() + dice_.Whole(kKinds));
    scene_ = TableOnly();
    for (InstanceId id = 1; id <= 3; ++id) {
      AddToy(kinds[id - 1U], id, scene_);
      scene_.T_WO[id] = FreePlace(id);
    }
    mover_ = static_cast<InstanceId>(1 + dice_.Whole(3));
    gone_ = 6 + dice_.Whole(12);
    slides_in_ = dice_.Whole(2) == 0;
    angle_ = dice_.Uniform(0, 2 * std::numbers::pi);
  }

  Outcome Run() {
    PipelineConfig config;
    config.method = Method::kTsdfppAnchored;
    config.map.voxel_m = kVoxel_m;
    EXPECT_TRUE(config.map.SetProfile("close").has_value());
    config.associate = AssociationMode::kVotes;
    config.poses = PoseSource::kIcp;
    EXPECT_TRUE(config.Validate().has_value());
    Pipeline pipeline(config, {});
    Outcome outcome;
    std::map<InstanceId, InstanceId> id_of;
    int index = 0;
    const auto map = [&](const reference::Scene& scene) {
      const Frame truth = FrameOf(scene, index++);
      Frame frame = truth;
      frame.mask = ids_.Of(truth.mask);
      frame.T_WO.clear();
      EXPECT_TRUE(pipeline.Process(frame).has_value());
      return VoteWorld::MostOf(truth.mask, pipeline.labels());
    };
    for (int i = 0; i < kSeen; ++i) id_of = map(scene_);
    outcome.before = id_of.at(mover_);
    reference::Scene without = scene_;
    without.Erase(mover_);
    for (int i = 0; i < gone_; ++i) map(without);
    const Pose T_WO = FreePlace(mover_);
    for (int i = 0; i < kBack; ++i) {
      scene_.T_WO[mover_] = T_WO;
      // From the side of the table, to its place in the seventh frame.
      if (slides_in_) scene_.T_WO[mover_].translation().x() += 0.06 * std::max(0, 6 - i);
      const auto now = map(scene_);
      const auto of_mover = now.find(mover_);
      if (of_mover == now.end() || of_mover->second == kNoInstance) continue;
      if (!outcome.frames) outcome.frames = i + 1;
      outcome.after = of_mover->second;
    }
    const auto last = map(scene_);
    for (const auto& [object, id] : id_of) {
      if (object != mover_ && last.contains(object)) {
        outcome.others_kept = outcome.others_kept && last.at(object) == id;
      }
    }
    return outcome;
  }

 private:
  // On the table, clear of the other toys.
  Pose FreePlace(InstanceId id) {
    for (;;) {
      const Pose place = OnTable(dice_.Uniform(-0.2, 0.2), dice_.Uniform(-0.16, 0.16),
                                 dice_.Uniform(0, 2 * std::numbers::pi));
      const bool is_free =
          std::all_of(scene_.T_WO.begin(), scene_.T_WO.end(), [&](const auto& other) {
            return other.first == id ||
                   (other.second.translation() - place.translation()).norm() > 2 * kToyRadius_m;
          });
      if (is_free) return place;
    }
  }

  // The camera goes once round the table, so that it has seen what may be turned to it later, and
  // then slowly on.
  Frame FrameOf(const reference::Scene& scene, int index) const {
    const double round = 2 * std::numbers::pi * std::min(index, kSeen) / kSeen;
    const double angle = angle_ + round + 0.02 * index;
    const Pose T_WC =
        reference::LookAt({0.6 * std::cos(angle), 0.6 * std::sin(angle), 0.5}, {0, 0, 0.03});
    Frame frame = reference::Render(scene, T_WC, index, {128, 96, 120, 120, 63.5, 47.5});
    frame.time_s = index / kFrameRate_hz;
    return frame;
  }

  Dice dice_;
  DrawnIds ids_;
  reference::Scene scene_;
  InstanceId mover_ = kNoInstance;
  int gone_ = 0;
  bool slides_in_ = false;
  double angle_ = 0;
};

// All 300 with TSDFPP_REENTRY_CASES=300; a few of them in every build.
TEST(Reentry, TheRightIdComesBack) {
  constexpr int kFew = 10;
  constexpr double kRight = 0.97;
  constexpr int kWrong = 1;
  constexpr int kMostFrames = 15;
  const char* typed = std::getenv("TSDFPP_REENTRY_CASES");
  const int cases = typed == nullptr ? kFew : std::atoi(typed);
  int right = 0;
  int wrong = 0;  // another object's id
  std::string failures;
  for (int seed = 1; seed <= cases; ++seed) {
    const Outcome outcome = Case(static_cast<std::uint64_t>(seed)).Run();
    ASSERT_NE(outcome.before, kNoInstance) << "seed " << seed;
    const bool is_right = outcome.after == outcome.before && outcome.frames &&
                          *outcome.frames <= kMostFrames && outcome.others_kept;
    right += is_right ? 1 : 0;
    const bool is_wrong =
        outcome.after != kNoInstance && outcome.after != outcome.before && outcome.after <= 3;
    wrong += is_wrong ? 1 : 0;
    if (is_right) continue;
    failures += fmt::format("seed {}: id {} came back as {} after {} frames{}\n", seed,
                            outcome.before, outcome.after, outcome.frames.value_or(-1),
                            outcome.others_kept ? "" : ", and the others have other ids");
  }
  fmt::print("of {} cases {} right, {} with another object's id\n{}", cases, right, wrong,
             failures);
  EXPECT_GE(right, kRight * cases);
  EXPECT_LE(wrong, kWrong);
}

TEST(ReentryConfig, SurvivesToml) {
  const ReentryConfig config{false, 5, 2, 30, 10, 20, 200, 0.7, 0.6, 0.2, 0.1};
  const auto read = ReentryConfig::FromToml(config.ToToml(), "t.toml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, config);
  EXPECT_EQ(*ReentryConfig::FromToml(toml::table{}, "t.toml"), ReentryConfig{});
}

TEST(ReentryConfig, NamesWhatIsWrong) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"wait_frames = -1", "'wait_frames' is -1, expected 0 to 1000"},
      {"speed_m_s = -1.0", "'speed_m_s' is -1, expected 0 to 1000000"},
      {"directions = 0", "'directions' is 0, expected 1 to 1000"},
      {"turns = 0", "'turns' is 0, expected 1 to 1000"},
      {"refined = 0", "'refined' is 0, expected 1 to 1000"},
      {"max_points = 9", "'max_points' is 9, expected 10 to 1000000"},
      {"min_on_surface = 1.5", "'min_on_surface' is 1.5, expected 0 to 1"},
      {"min_seen = -0.5", "'min_seen' is -0.5, expected 0 to 1"},
      {"max_colour = 2.0", "'max_colour' is 2, expected 0 to 1"},
      {"min_lead = 2.0", "'min_lead' is 2, expected 0 to 1"},
      {"enabled = 1", "enabled"},
      {"speed = 2", "speed"}};
  for (const auto& [text, sentence] : cases) {
    SCOPED_TRACE(text);
    const auto table = ParseToml(text, "t.toml");
    ASSERT_TRUE(table);
    const auto config = ReentryConfig::FromToml(*table, "t.toml");
    ASSERT_FALSE(config);
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    EXPECT_NE(config.error().message.find(sentence), std::string::npos) << config.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
