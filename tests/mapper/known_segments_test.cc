// What is known of segments from frame to frame: carried between the frames in which a network
// looks, and known with a latency where it runs beside them; against the same step by step.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "mapper/segment/joined_segments.h"

namespace tsdfpp {
namespace {

Instance BoxOf(const cv::Rect& box, const std::string& name, float score) {
  return {box, cv::Mat(box.size(), CV_8UC1, cv::Scalar(255)), name, score};
}

cv::Mat Row(std::initializer_list<std::uint16_t> ids) {
  return cv::Mat(std::vector<std::uint16_t>(ids), true).reshape(1, 1);
}

// Finds one box, and counts how often it was asked.
class BoxFinder : public InstanceFinder {
 public:
  Expected<std::vector<Instance>> Find(const Frame&) override {
    ++asked;
    return std::vector<Instance>{BoxOf({1, 1, 2, 2}, "box", 1)};
  }
  int asked = 0;
};

TEST(InstanceSegments, FramesBetweenHaveNone) {
  const auto finder = std::make_shared<BoxFinder>();
  NetworkConfig config;
  config.every = 3;
  InstanceSegments segmenter(finder, config);
  Frame frame;
  frame.depth = cv::Mat(4, 4, CV_32FC1, cv::Scalar(1));
  for (int i = 0; i < 7; ++i) {
    const Segments segments = segmenter.Segment(frame).value();
    if (i % 3 == 0) {
      EXPECT_EQ(cv::countNonZero(segments.ids == 1), 4);
      EXPECT_EQ(cv::countNonZero(segments.ids == kBackground), 12);
      EXPECT_EQ(segments.classes.at(1), "box");
    } else {
      EXPECT_EQ(cv::countNonZero(segments.ids == kNoInstance), 16);
      EXPECT_TRUE(segments.classes.empty());
    }
  }
  EXPECT_EQ(finder->asked, 3);
}

// A thing of two segments that moves by a pixel a frame, a cube that no network knows, and a book
// that is a mask alone.
TEST(KnownSegments, AreCarriedWithTheSegments) {
  const auto frame = [](int at) {
    cv::Mat ids(1, 24, CV_16UC1, cv::Scalar(0));
    ids(cv::Rect(at, 0, 4, 1)) = 2;
    ids(cv::Rect(at + 4, 0, 3, 1)) = 1;
    ids(cv::Rect(18, 0, 5, 1)) = 3;
    return ids;
  };
  KnownSegments known(NetworkConfig{});
  known.Set(frame(2), std::vector<Instance>{BoxOf({2, 0, 7, 1}, "mug", 0.9F),
                                            BoxOf({13, 0, 3, 1}, "book", 0.9F)});
  for (int at = 3; at < 6; ++at) {
    const Segments& carried = known.Carry(frame(at));
    cv::Mat expected(1, 24, CV_16UC1, cv::Scalar(0));
    expected(cv::Rect(at, 0, 7, 1)) = 1;
    expected(cv::Rect(13, 0, 3, 1)) = 2;
    expected(cv::Rect(18, 0, 5, 1)) = 3;
    EXPECT_EQ(cv::countNonZero(carried.ids != expected), 0) << carried.ids;
    EXPECT_EQ(carried.classes, (std::map<InstanceId, std::string>{{1, "mug"}, {2, "book"}}));
    EXPECT_EQ(carried.unknown, std::vector<InstanceId>{3});
  }
  // It is gone: what shows itself there is not it.
  cv::Mat others(1, 24, CV_16UC1, cv::Scalar(0));
  others(cv::Rect(18, 0, 5, 1)) = 1;
  EXPECT_EQ(known.Carry(others).classes, (std::map<InstanceId, std::string>{{1, "book"}}));
}

// A pixel without a segment is filled up where the instance was found, and not later.
TEST(KnownSegments, WhatWasFilledUpIsNotCarried) {
  KnownSegments known(NetworkConfig{});
  const std::vector<Instance> instances{BoxOf({0, 0, 5, 1}, "mug", 0.9F),
                                        BoxOf({7, 0, 2, 1}, "pin", 0.9F)};
  const cv::Mat depth = Row({1, 1, 1, 1, kNoInstance, 0, 0, kNoInstance, kNoInstance, 0});
  const cv::Mat found = Row({1, 1, 1, 1, 1, 0, 0, 2, 2, 0});
  EXPECT_EQ(cv::countNonZero(known.Set(depth, instances).ids != found), 0) << known.last().ids;
  // The pin is a mask alone, as no segment is there.
  const cv::Mat carried = Row({1, 1, 1, 1, kNoInstance, 0, 0, 2, 2, 0});
  EXPECT_EQ(cv::countNonZero(known.Carry(depth).ids != carried), 0) << known.last().ids;
  // Of another size nothing is known.
  EXPECT_TRUE(known.Carry(Row({1, 1, 1})).classes.empty());
}

// A box of depth that moves, and finders that see it where it is.
Frame BoxFrame(int index) {
  Frame frame;
  frame.index = index;
  frame.intrinsics = {64, 48, 60, 60, 31.5, 23.5};
  frame.depth = cv::Mat(48, 64, CV_32FC1, cv::Scalar(1));
  frame.depth(cv::Rect(4 + index, 10, 20, 20)) = 0.7F;
  return frame;
}

class MovingBoxFinder : public InstanceFinder {
 public:
  Expected<std::vector<Instance>> Find(const Frame& frame) override {
    asked.push_back(frame.index);
    // The second box is not there, and is another one every time.
    std::this_thread::sleep_for(std::chrono::milliseconds(7 * (frame.index % 3)));
    if (frame.index == fails_at) return DataError("frame {}: no", frame.index);
    return std::vector<Instance>{
        BoxOf({4 + frame.index, 10, 20, 20}, fmt::format("seen at {}", frame.index), 1),
        BoxOf({50, 2 * frame.index, 4, 4}, "book", 1)};
  }
  std::vector<int> asked;
  int fails_at = -1;
};

TEST(JoinedSegments, WhatIsFoundBecomesKnownWithItsLatency) {
  constexpr int kFrames = 14;
  for (const int every : {1, 2, 4}) {
    for (int latency = 0; latency <= every; ++latency) {
      SCOPED_TRACE(testing::Message() << "every " << every << ", latency " << latency);
      NetworkConfig config;
      config.every = every;
      config.latency = latency;
      config.gives_way = latency > 0 && every == 4;
      const auto finder = std::make_shared<MovingBoxFinder>();
      auto segmenter = std::make_unique<JoinedSegments>(finder, config, DepthSegmentsConfig{});
      std::vector<int> asked;
      for (int i = 0; i < kFrames; ++i) {
        if (i % every == 0) asked.push_back(i);
        // From the last frame whose instances are known by now on.
        const int begin = std::max(0, i - latency) / every * every;
        DepthSegments depth;
        MovingBoxFinder again;
        KnownSegments known(config);
        known.Set(depth.Segment(BoxFrame(begin)).value().ids, again.Find(BoxFrame(begin)).value());
        for (int k = begin + 1; k <= i; ++k) known.Carry(depth.Segment(BoxFrame(k)).value().ids);
        const Segments found = segmenter->Segment(BoxFrame(i)).value();
        ASSERT_EQ(cv::countNonZero(found.ids != known.last().ids), 0) << "frame " << i;
        ASSERT_EQ(found.classes, known.last().classes);
        ASSERT_EQ(found.unknown, known.last().unknown);
        EXPECT_EQ(found.classes.at(1), fmt::format("seen at {}", begin));
      }
      segmenter.reset();  // waits for the last search
      EXPECT_EQ(finder->asked, asked);
    }
  }
}

// On how many cores this thread may run.
int Cores() {
  cpu_set_t cores;
  return sched_getaffinity(0, sizeof cores, &cores) == 0 ? CPU_COUNT(&cores) : 0;
}

// Which thread looks, by which policy, on how many cores it may be, and on how many threads it
// could run OpenCV's loops.
class WatchingFinder : public InstanceFinder {
 public:
  struct Look {
    std::thread::id thread;
    int policy = 0;
    int cores = 0;
    std::set<std::thread::id> helpers;
  };

  Expected<std::vector<Instance>> Find(const Frame& frame) override {
    Look look{std::this_thread::get_id(), sched_getscheduler(0), Cores(), {}};
    std::mutex mutex;
    cv::parallel_for_(cv::Range(0, 64), [&](const cv::Range&) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      const std::lock_guard lock(mutex);
      look.helpers.insert(std::this_thread::get_id());
    });
    looks.push_back(std::move(look));
    return std::vector<Instance>{BoxOf({4 + frame.index, 10, 20, 20}, "book", 1)};
  }
  std::vector<Look> looks;
};

TEST(JoinedSegments, ANetworkThatGivesWayHasOneLessUrgentThread) {
  const int policy = sched_getscheduler(0);
  for (const bool gives_way : {false, true}) {
    NetworkConfig config;
    config.every = 2;
    config.latency = 2;
    config.gives_way = gives_way;
    const auto finder = std::make_shared<WatchingFinder>();
    auto segmenter = std::make_unique<JoinedSegments>(finder, config, DepthSegmentsConfig{});
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(segmenter->Segment(BoxFrame(i)).has_value());
    segmenter.reset();  // waits for the last search
    ASSERT_EQ(finder->looks.size(), 3U);
    // Of the first image something must be known at once.
    EXPECT_EQ(finder->looks[0].thread, std::this_thread::get_id());
    for (const std::size_t i : {1U, 2U}) {
      const WatchingFinder::Look& look = finder->looks[i];
      EXPECT_NE(look.thread, std::this_thread::get_id());
      EXPECT_EQ(look.policy, gives_way ? SCHED_IDLE : policy);
      if (gives_way) {
        EXPECT_EQ(look.helpers, std::set{look.thread});
      }
    }
    EXPECT_EQ(sched_getscheduler(0), policy);
  }
}

// Nobody else runs on the core of a network that gives way where the map's threads are fewer than
// cores; where they are as many, it keeps to one of them.
TEST(JoinedSegments, ANetworkThatGivesWayKeepsToOneOfTheMapsCores) {
  const int cores = Cores();
  ASSERT_GT(cores, 0);
  const auto cores_with = [](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    NetworkConfig config;
    config.every = 2;
    config.latency = 2;
    config.gives_way = true;
    const auto finder = std::make_shared<WatchingFinder>();
    auto segmenter = std::make_unique<JoinedSegments>(finder, config, DepthSegmentsConfig{});
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(segmenter->Segment(BoxFrame(i)).has_value());
    segmenter.reset();  // waits for the last search
    return finder->looks.back().cores;
  };
  EXPECT_EQ(cores_with(static_cast<std::size_t>(cores)), 1);
  EXPECT_EQ(cores_with(1), cores);
  EXPECT_EQ(Cores(), cores);
}

TEST(JoinedSegments, AnImageOfAnotherSizeBeginsAnew) {
  NetworkConfig config;
  config.every = 4;
  config.latency = 3;
  const auto finder = std::make_shared<MovingBoxFinder>();
  JoinedSegments segmenter(finder, config, {});
  for (int i = 0; i < 12; ++i) {
    Frame frame = BoxFrame(i);
    if (i >= 6) {
      frame.intrinsics.width = 60;
      frame.intrinsics.height = 40;
      frame.depth = frame.depth(cv::Rect(0, 0, 60, 40)).clone();
    }
    const Segments segments = segmenter.Segment(frame).value();
    ASSERT_EQ(segments.ids.size(), frame.depth.size());
    // Frame 4's search is given up; 8's is known at 11.
    const int known_since = i < 6 ? 0 : i < 11 ? 6 : 8;
    EXPECT_EQ(segments.classes.at(1), fmt::format("seen at {}", known_since)) << i;
  }
}

TEST(JoinedSegments, AnErrorOfTheFinderComesWithItsLatency) {
  NetworkConfig config;
  config.every = 3;
  config.latency = 2;
  const auto finder = std::make_shared<MovingBoxFinder>();
  finder->fails_at = 3;
  JoinedSegments segmenter(finder, config, {});
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(segmenter.Segment(BoxFrame(i)).has_value()) << i;
  const auto wrong = segmenter.Segment(BoxFrame(5));
  ASSERT_FALSE(wrong.has_value());
  EXPECT_EQ(wrong.error().message, "frame 3: no");
}

// A program's own finder may give anything.
TEST(FindInstances, SaysWhatIsNoInstance) {
  class Given : public InstanceFinder {
   public:
    explicit Given(std::vector<Instance> instances) : instances_(std::move(instances)) {}
    Expected<std::vector<Instance>> Find(const Frame&) override { return instances_; }

   private:
    std::vector<Instance> instances_;
  };
  const Instance good = BoxOf({1, 0, 3, 4}, "box", 1);
  const auto with = [&](const auto& change) {
    Instance instance = good;
    change(instance);
    return std::vector<Instance>{good, instance};
  };
  constexpr int kBig = std::numeric_limits<int>::max();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<std::pair<std::vector<Instance>, std::string>> cases{
      {with([](Instance& i) { i.box.x = 2; }), "a box of 3 x 4 pixels at (2, 0), expected one in"},
      {with([](Instance& i) { i.box.y = -1; }), "in the image of 4 x 4"},
      {with([](Instance& i) { i.box.width = -3; }), "a box of -3 x 4"},
      {with([](Instance& i) {
         i.box = {kBig, kBig, kBig, kBig};
       }),
       "a box of 2147483647"},
      {with([](Instance& i) { i.mask = i.mask.rowRange(0, 3); }), "a mask of 3 x 3 pixels"},
      {with([](Instance& i) { i.mask = cv::Mat(); }), "a mask of 0 x 0 pixels"},
      {with([](Instance& i) { i.mask.convertTo(i.mask, CV_32F); }),
       "type CV_32FC1, expected 3 x 4"},
      {with([](Instance& i) { i.semantic_class = ""; }), "no class"},
      {with([](Instance& i) { i.score = kNan; }), "a score of nan, expected 0 to 1"},
      {with([](Instance& i) { i.score = -0.1F; }), "a score of -0.1"},
      {std::vector<Instance>(kNoInstance, good), "65535 instances, expected 65534 at most"},
  };
  Frame frame;
  frame.index = 7;
  frame.intrinsics = {4, 4, 5, 5, 1.5, 1.5};
  frame.depth = cv::Mat(4, 4, CV_32FC1, cv::Scalar(1));
  for (const auto& [instances, words] : cases) {
    NetworkConfig config;
    InstanceSegments alone(std::make_shared<Given>(instances), config);
    JoinedSegments joined(std::make_shared<Given>(instances), config, DepthSegmentsConfig{});
    for (Segmenter* segmenter :
         {static_cast<Segmenter*>(&alone), static_cast<Segmenter*>(&joined)}) {
      const auto segments = segmenter->Segment(frame);
      ASSERT_FALSE(segments.has_value()) << words;
      EXPECT_EQ(segments.error().kind, ErrorKind::kData);
      EXPECT_TRUE(segments.error().message.starts_with("frame 7: ")) << segments.error().message;
      EXPECT_NE(segments.error().message.find(words), std::string::npos)
          << segments.error().message;
    }
  }
  // What it may be at most.
  Given edge({BoxOf({0, 0, 4, 4}, "box", 0), BoxOf({4, 4, 0, 0}, "none", 1)});
  EXPECT_TRUE(FindInstances(edge, frame).has_value());
}

}  // namespace
}  // namespace tsdfpp
