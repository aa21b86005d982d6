// Who is tracked (paper III-D).
#include "mapper/track/tracked_objects.h"

#include <gtest/gtest.h>

namespace tsdfpp {
namespace {

using Ids = std::vector<InstanceId>;

Ids Selected(const TrackedObjects& tracked, const Ids& ids) {
  cv::Mat row(1, static_cast<int>(ids.size()), CV_16UC1);
  std::copy(ids.begin(), ids.end(), row.ptr<InstanceId>());
  const cv::Mat selected = tracked.Select(row);
  return {selected.ptr<InstanceId>(), selected.ptr<InstanceId>() + selected.cols};
}

TEST(TrackedObjects, AreThoseThatWereOnceClassified) {
  TrackedObjects tracked(TrackChoice::kClassified,
                         {{0, "room", "room"}, {3, "a", "car"}, {4, "b", ""}});
  EXPECT_EQ(Selected(tracked, {0, 3, 4, 5, kNoInstance}),
            (Ids{0, 3, kNoInstance, kNoInstance, kNoInstance}));
  tracked.Learn(5, "cup");
  tracked.Learn(4, "");
  tracked.Learn(0, "room");
  EXPECT_EQ(Selected(tracked, {0, 3, 4, 5, kNoInstance}), (Ids{0, 3, kNoInstance, 5, kNoInstance}));
}

TEST(TrackedObjects, AreAllButTheBackgroundWhereAllAreAsked) {
  for (const TrackChoice choice : {TrackChoice::kAll, TrackChoice::kMoving}) {
    const TrackedObjects tracked(choice, {{3, "a", "car"}});
    EXPECT_EQ(tracked.choice(), choice);
    EXPECT_EQ(Selected(tracked, {0, 3, kNoInstance, 4}), (Ids{0, 3, kNoInstance, 4}));
    EXPECT_FALSE(tracked.Contains(kBackground));
    EXPECT_FALSE(tracked.Contains(kNoInstance));
  }
}

TEST(TrackedObjects, AreTheClassifiedOnesFromWhenAClassIsKnown) {
  TrackedObjects tracked(TrackChoice::kAuto, {{0, "room", "room"}, {4, "b", ""}});
  EXPECT_EQ(tracked.choice(), TrackChoice::kAll);
  EXPECT_TRUE(tracked.Contains(4));
  tracked.Learn(5, "cup");
  EXPECT_EQ(tracked.choice(), TrackChoice::kClassified);
  EXPECT_FALSE(tracked.Contains(4));
  EXPECT_TRUE(tracked.Contains(5));
}

TEST(TrackedObjects, HaveTheClassThatTheyWereGivenMostOften) {
  TrackedObjects tracked(TrackChoice::kAuto, {});
  for (const std::string name : {"cup", "bowl", "cup", "bowl", "bowl", "cup"}) {
    tracked.Learn(7, name);
  }
  EXPECT_EQ(tracked.ClassOf(7), "bowl");  // as often as the cup, and before it in the alphabet
  tracked.Learn(7, "cup");
  EXPECT_EQ(tracked.ClassOf(7), "cup");
  EXPECT_EQ(tracked.ClassOf(8), "");
}

TEST(TrackChoice, HasNames) {
  for (const TrackChoice choice :
       {TrackChoice::kAuto, TrackChoice::kAll, TrackChoice::kClassified, TrackChoice::kMoving}) {
    EXPECT_EQ(TrackChoiceFromName(TrackChoiceName(choice)).value(), choice);
  }
  EXPECT_FALSE(TrackChoiceFromName("some").has_value());
}

}  // namespace
}  // namespace tsdfpp
