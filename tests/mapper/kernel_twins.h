// What tests share that hold a kernel of vectors against its plain twin, bit by bit.
#pragma once

#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <hwy/targets.h>

#include <bit>
#include <cmath>

#include "mapper/kernels.h"
#include "mapper/volume/tsdf_block.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {

// Runs the test with each instruction set that this machine has.
template <typename Test>
void OnEveryInstructionSet(const Test& test) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    test();
    hwy::SetSupportedTargetsForTest(0);
    if (::testing::Test::HasFatalFailure()) return;
  }
}

// Uses the plain kernels while it lives.
class PlainKernels {
 public:
  PlainKernels() { UseKernels(Kernels::kPlain); }
  ~PlainKernels() { UseKernels(Kernels::kSimd); }
  PlainKernels(const PlainKernels&) = delete;
  PlainKernels& operator=(const PlainKernels&) = delete;
};

// Not numbers are equal to each other: which of them an instruction gives is nobody's business.
inline bool SameBits(float a, float b) {
  if (std::isnan(a) || std::isnan(b)) return std::isnan(a) && std::isnan(b);
  return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

inline BlockMask RandomMask(Dice& dice, double density) {
  BlockMask mask{};
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (dice.Uniform(0, 1) < density) SetBit(mask, i);
  }
  return mask;
}

inline float RandomDistance(Dice& dice, float front, float back) {
  switch (dice.Whole(6)) {
    case 0:
      return front;  // free space
    case 1:
      return -back;
    case 2:  // subnormal in half precision, and what rounds to zero
      return static_cast<float>(dice.Whole(9) - 4) * 0x1p-25F;
    default:
      return static_cast<float>(dice.Uniform(-back, front));
  }
}

struct BlockDraw {
  float front = 0;
  float back = 0;
  int weight_cap = 0;
  double observed = 1;
  double coloured = 0.5;  // of the slices
};

// Values of all kinds, masks as they follow from them; of the full weights some are known.
inline void DrawBlock(Dice& dice, const BlockDraw& draw, TsdfBlock& block) {
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const bool observed = dice.Uniform(0, 1) < draw.observed;
    const bool at_cap = dice.Whole(2) == 0;
    block.distance[i] = observed ? RandomDistance(dice, draw.front, draw.back) : 0.0F;
    block.weight[i] = static_cast<std::uint8_t>(
        observed ? (at_cap ? draw.weight_cap : 1 + dice.Whole(draw.weight_cap)) : 0);
  }
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    if (dice.Uniform(0, 1) >= draw.coloured) continue;
    for (std::size_t k = 0; k < kSliceVoxels; ++k) {
      const std::size_t i = kSliceVoxels * z + k;
      if (block.weight[i] == 0) continue;
      const int count = dice.Whole(2) == 0 ? 0 : 1 + dice.Whole(draw.weight_cap);
      FixedColour colour{};
      for (std::uint16_t& channel : colour) {
        if (count > 0) channel = static_cast<std::uint16_t>(dice.Whole(0xFF01));
      }
      block.SetColour(i, colour, count);
    }
  }
  block.UpdateMasks(draw.back);
  for (int i = 0; i < kBlockVoxels; ++i) {
    const bool is_full = block.weight[static_cast<std::size_t>(i)] == draw.weight_cap;
    if (is_full && dice.Whole(4) > 0) SetBit(block.full, i);
  }
}

inline ::testing::AssertionResult SameBlocks(const TsdfBlock& a, const TsdfBlock& b) {
  const auto differ = [](const char* what) { return ::testing::AssertionFailure() << what; };
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    if (std::bit_cast<std::uint16_t>(a.distance[i]) !=
        std::bit_cast<std::uint16_t>(b.distance[i])) {
      return differ("distance of voxel ") << i << ": " << a.distance[i] << ", " << b.distance[i];
    }
    if (a.weight[i] != b.weight[i]) return differ("weight of voxel ") << i;
  }
  if (a.observed != b.observed) return differ("observed");
  if (a.negative != b.negative) return differ("negative");
  if (a.band != b.band) return differ("band");
  if (a.full != b.full) return differ("full");
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    const auto& of_a = a.colours[z];
    const auto& of_b = b.colours[z];
    if ((of_a == nullptr) != (of_b == nullptr)) return differ("which slices have colours");
    if (of_a == nullptr) continue;
    if (of_a->channel != of_b->channel) return differ("colours of slice ") << z;
    if (of_a->count != of_b->count) return differ("numbers of colours of slice ") << z;
  }
  return ::testing::AssertionSuccess();
}

}  // namespace tsdfpp
