// Lanes of half precision, with every instruction set, against the numbers one by one.
#include <gtest/gtest.h>

#include <vector>

#include "core/half.h"
#include "tests/core/half_values.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/mapper/half_lanes_test.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/volume/half_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Rounds, stores and loads; the count is a multiple of 16.
void ThroughHalves(const float* from, std::size_t count, float* to) {
  const hn::CappedTag<float, 16> df;
  std::vector<Half> halves(count);
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    StoreHalves(df, RoundLanesToHalf(df, hn::LoadU(df, from + i)), &halves[i]);
    hn::StoreU(LoadHalves(df, &halves[i]), df, to + i);
  }
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {
namespace {

HWY_EXPORT(ThroughHalves);

TEST(HalfLanes, OfEveryInstructionSetRoundLikeOne) {
  const std::vector<float> values = test::FloatsAtHalves(0x1p15F);
  std::vector<float> back(values.size());
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    HWY_DYNAMIC_DISPATCH(ThroughHalves)(values.data(), values.size(), back.data());
    hwy::SetSupportedTargetsForTest(0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      test::ExpectSameHalf(back[i], RoundToHalf(values[i]), values[i]);
      if (HasFatalFailure()) {
        ADD_FAILURE() << hwy::TargetName(target);
        return;
      }
    }
  }
}

}  // namespace
}  // namespace tsdfpp
#endif
