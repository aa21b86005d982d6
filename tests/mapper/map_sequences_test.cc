// Random sequences of events through every method and its dense reference (tests/reference), every
// voxel compared after each. A failure is shrunk to a short sequence that reads like a story; more
// of them: RC_PARAMS="max_success=1000 seed=7" mapper_tests --gtest_filter='*Sequences*'.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cstdlib>

#include "tests/mapper/compare_maps.h"
#include "tests/mapper/methods_of_tests.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::Scene;

// The same sequences on every run, unless the caller asks for others; read before main.
const bool kParametersSet = [] {
  return setenv("RC_PARAMS", "max_success=60 seed=20211", 0) == 0;
}();

// The toys of toy_scene.h in voxels of 4 cm, seen by 48x36 pixels: all that happens within 7 cm of
// the middle of the table fits in 48x48x32 voxels, blocks and their turned corners included.
constexpr double kCoarseVoxel_m = 0.04;
constexpr double kStep_m = 0.01;
constexpr int kMostSteps = 7;
constexpr double kEventsOfSize = 0.12;  // at most 12 events, at RapidCheck's size of 100
reference::Box SmallBox() { return {{-24, -24, -16}, {23, 23, 15}}; }
Intrinsics TinyCamera() { return {48, 36, 40.0, 40.0, 23.5, 17.5}; }

enum class Kind { kFuse, kMove, kRemove, kOcclude, kMislabel, kSamePose, kCount };

// Whole numbers, of which 0 is the plainest: what RapidCheck shrinks to.
struct Event {
  Kind kind = Kind::kFuse;
  int toy = 0;                 // of Toys()
  std::array<int, 3> steps{};  // a toy's place, centimetres from where it starts or rests
  int turn = 0;                // of the toy, 10 degrees each
  int tilt = 0;                // the same, about x
  int camera = 0;              // place on its circle, 15 degrees each
};

constexpr std::array<InstanceId, 3> kToys{kBrick, kBall, kTray};
constexpr std::array<const char*, 3> kToyNames{"brick", "ball", "tray"};

[[maybe_unused]] void showValue(const Event& event, std::ostream& out) {
  const char* toy = kToyNames[static_cast<std::size_t>(event.toy)];
  const std::string place =
      fmt::format("({}, {}, {}) cm, turned {}, tilted {}", event.steps[0], event.steps[1],
                  event.steps[2], 10 * event.turn, 10 * event.tilt);
  switch (event.kind) {
    case Kind::kFuse:
      out << fmt::format("{} goes to {}; a frame from {}", toy, place, 15 * event.camera);
      break;
    case Kind::kMove:
      out << fmt::format("{} is moved to {}, unseen", toy, place);
      break;
    case Kind::kRemove:
      out << toy << " is removed";
      break;
    case Kind::kOcclude:
      out << fmt::format("a frame from {} with a hole in depth and {} without a pose",
                         15 * event.camera, toy);
      break;
    case Kind::kMislabel:
      out << fmt::format("a frame from {} in which half of {} is taken for {}", 15 * event.camera,
                         toy, kToyNames[static_cast<std::size_t>((event.toy + 1) % 3)]);
      break;
    default:
      out << toy << " is given the pose that it has";
  }
}

// The settings that rules depend on.
struct Settings {
  bool thin_band = false;
  int layers = 0;
  bool soon_full = false;  // weights and confidences saturate at once
  bool trusting = false;   // no contradiction
  bool relisting = false;
  bool observed = false;  // resampling
  int moved_confidence = 1;
};

[[maybe_unused]] void showValue(const Settings& s, std::ostream& out) {
  out << fmt::format(
      "back {}, layers {}, caps {}, contradiction {}, relist {}, resampling {}, moved_confidence "
      "{}",
      s.thin_band ? 2 : 3, s.layers, s.soon_full ? 2 : 50, !s.trusting, s.relisting,
      s.observed ? "observed" : "all", s.moved_confidence);
}

MapConfig ConfigOf(Method method, const Settings& settings) {
  MapConfig config;
  config.voxel_m = kCoarseVoxel_m;
  config.trunc_front_voxels = 3;
  config.trunc_back_voxels = settings.thin_band ? 2 : 3;
  config.weight_cap = settings.soon_full ? 2 : 50;
  config.confidence_cap = settings.soon_full ? 2 : 10;
  config.moved_confidence = std::min(settings.moved_confidence, config.confidence_cap);
  config.contradiction = !settings.trusting;
  config.relist_on_removal = settings.relisting;
  config.resampling = settings.observed ? Resampling::kObserved : Resampling::kAll;
  if (method == Method::kTsdfpp || method == Method::kTsdfppAnchored) {
    config.layers = settings.layers;
  }
  return config;
}

}  // namespace
}  // namespace tsdfpp

namespace rc {

template <>
struct Arbitrary<tsdfpp::Event> {
  static Gen<tsdfpp::Event> arbitrary() {
    using tsdfpp::Event;
    using tsdfpp::Kind;
    const auto whole = [](int most) { return gen::inRange(0, most + 1); };
    const auto either = [](int most) { return gen::inRange(-most, most + 1); };
    // Frames and moves are what the others need to mean anything.
    const auto kind = gen::map(whole(9), [](int drawn) {
      return drawn < static_cast<int>(Kind::kCount) ? static_cast<Kind>(drawn)
             : drawn < 8                            ? Kind::kFuse
                                                    : Kind::kMove;
    });
    return gen::build<Event>(
        gen::set(&Event::kind, kind), gen::set(&Event::toy, whole(2)),
        gen::set(
            &Event::steps,
            gen::map(gen::tuple(either(tsdfpp::kMostSteps), either(tsdfpp::kMostSteps), whole(4)),
                     [](const std::tuple<int, int, int>& t) {
                       return std::array{std::get<0>(t), std::get<1>(t), std::get<2>(t)};
                     })),
        gen::set(&Event::turn, either(9)), gen::set(&Event::tilt, either(1)),
        gen::set(&Event::camera, whole(23)));
  }
};

template <>
struct Arbitrary<tsdfpp::Settings> {
  static Gen<tsdfpp::Settings> arbitrary() {
    using tsdfpp::Settings;
    const auto flag = gen::arbitrary<bool>();
    return gen::build<Settings>(
        gen::set(&Settings::thin_band, flag), gen::set(&Settings::layers, gen::inRange(0, 9)),
        gen::set(&Settings::soon_full, flag), gen::set(&Settings::trusting, flag),
        gen::set(&Settings::relisting, flag), gen::set(&Settings::observed, flag),
        gen::set(&Settings::moved_confidence, gen::inRange(1, 4)));
  }
};

}  // namespace rc

namespace tsdfpp {
namespace {

// The world of a sequence, and the two maps of it.
class Story {
 public:
  Story(Method method, const MapConfig& config)
      : scene_(TableOnly()),
        map_(MakeMap(method, config)),
        dense_(reference::MakeDenseMap(method, config, SmallBox())) {
    AddBrick(scene_, 0.3, Rest(kBrick));
    AddBall(scene_, Rest(kBall));
    AddTray(scene_, -0.4, Rest(kTray));
    const Frame first = reference::Render(scene_, CircleCamera(0.2), 1, TinyCamera());
    Fuse(first, first.mask);
  }

  void Play(const Event& event) {
    const InstanceId id = kToys[static_cast<std::size_t>(event.toy)];
    switch (event.kind) {
      case Kind::kMove:
        Place(id, event);
        SetPose(id);
        return;
      case Kind::kRemove:
        map_->Remove(id);
        dense_->Remove(id);
        return;
      case Kind::kSamePose:
        SetPose(id);
        return;
      default:
        break;
    }
    if (event.kind == Kind::kFuse) Place(id, event);
    const double angle = event.camera * M_PI / 12;
    Frame frame = reference::Render(scene_, CircleCamera(angle), 2, TinyCamera());
    cv::Mat labels = frame.mask.clone();
    if (event.kind == Kind::kOcclude) {
      const cv::Rect hole(std::abs(event.steps[0]) * 5, std::abs(event.steps[1]) * 3, 10, 12);
      frame.depth(hole).setTo(0);
      labels(cv::Rect(hole.y, hole.x / 2, 6, 4)).setTo(kNoInstance);
      frame.T_WO.erase(id);
    }
    if (event.kind == Kind::kMislabel) {
      cv::Mat half = labels(cv::Rect(0, 0, labels.cols, 12 + std::abs(event.steps[0])));
      half.setTo(kToys[static_cast<std::size_t>((event.toy + 1) % 3)], half == id);
    }
    Fuse(frame, labels);
  }

  ::testing::AssertionResult Same() const {
    for (const InstanceId id : ToyIds()) {
      if (auto same = SameObject(*map_, *dense_, id); !same) return same;
      if (map_->ObjectLattice(id).matrix() != dense_->ObjectLattice(id).matrix()) {
        return ::testing::AssertionFailure() << "the lattice of object " << id;
      }
    }
    return SameLists(*map_, *dense_);
  }

 private:
  static Eigen::Vector3d Rest(InstanceId id) {
    return {id == kBrick ? -0.06 : 0.05, id == kTray ? 0.06 : -0.04,
            kTableTop_m + (id == kTray ? 0.016 : 0.05)};
  }
  void Place(InstanceId id, const Event& event) {
    const Eigen::Vector3d shift = kStep_m * Eigen::Vector3d(event.steps[0], event.steps[1], 0);
    Pose& T_WO = scene_.T_WO[id];
    T_WO = reference::MakePose(event.turn * M_PI / 18, Eigen::Vector3d::UnitZ(), shift);
    T_WO.rotate(Eigen::AngleAxisd(event.tilt * M_PI / 18, Eigen::Vector3d::UnitX()));
    T_WO.translation().z() = Rest(id).z() + kStep_m * event.steps[2];
  }
  void SetPose(InstanceId id) {
    map_->SetObjectPose(id, scene_.T_WO.at(id));
    dense_->SetObjectPose(id, scene_.T_WO.at(id));
  }
  void Fuse(const Frame& frame, const cv::Mat& labels) {
    for (const auto& [id, T_WO] : frame.T_WO) SetPose(id);
    map_->Fuse(frame, labels);
    dense_->Fuse(frame, labels);
  }

  Scene scene_;
  std::unique_ptr<MapRepresentation> map_;
  std::unique_ptr<reference::DenseMap> dense_;
};

class Sequences : public ::testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(Methods, Sequences, ::testing::ValuesIn(VoxelMethods()),
                         [](const auto& parameters) {
                           std::string name(MethodName(parameters.param));
                           for (char& c : name) {
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           }
                           return name;
                         });

TEST_P(Sequences, EveryEventLeavesTheSameVoxelsAsTheDenseReference) {
  ASSERT_TRUE(kParametersSet);
  rc::detail::checkGTest([this] {
    // RapidCheck's size, which grows from case to case, is for the length alone.
    const auto full = [](const auto& generator) { return rc::gen::resize(100, generator); };
    const auto settings = *full(rc::gen::arbitrary<Settings>()).as("settings");
    const auto events =
        *rc::gen::scale(kEventsOfSize,
                        rc::gen::container<std::vector<Event>>(full(rc::gen::arbitrary<Event>())))
             .as("events");
    Story story(GetParam(), ConfigOf(GetParam(), settings));
    for (std::size_t i = 0; i < events.size(); ++i) {
      story.Play(events[i]);
      if (const auto same = story.Same(); !same) {
        RC_FAIL(fmt::format("after event {}: {}", i + 1, same.message()));
      }
    }
  });
}

}  // namespace
}  // namespace tsdfpp
