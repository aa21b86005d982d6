// The hash of blocks against a map of the standard library.
#include "mapper/volume/block_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <thread>
#include <vector>

#include "mapper/volume/block_pool.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

void ExpectSame(const BlockGrid<int>& grid, const std::map<Index3, int>& expected,
                const std::vector<Index3>& order) {
  ASSERT_EQ(grid.size(), expected.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    ASSERT_EQ(grid.entries()[i].index, order[i]) << "entry " << i;
    ASSERT_EQ(*grid.entries()[i].block, expected.at(order[i]));
    ASSERT_EQ(grid.Find(order[i]), grid.entries()[i].block.get());
  }
}

// A small box, so that what was erased comes back and searches run over each other.
TEST(BlockGrid, ErasesAndAddsAsAMapDoesAndKeepsTheOrder) {
  Dice dice(3);
  BlockGrid<int> grid;
  std::map<Index3, int> expected;
  std::vector<Index3> order;
  std::size_t erasures = 0;
  for (int round = 0; round < 300; ++round) {
    for (int i = dice.Whole(20); i > 0; --i) {
      const Index3 index{dice.Whole(8) - 4, dice.Whole(8) - 4, dice.Whole(8) - 4};
      if (grid.Find(index) != nullptr) continue;
      grid.FindOrAdd(index) = expected[index] = round * 100 + i;
      order.push_back(index);
    }
    std::vector<Index3> erased;
    const int share = 1 + dice.Whole(12);
    for (const Index3& index : order) {
      if (dice.Whole(share) == 0) erased.push_back(index);
    }
    if (round % 2 == 0) std::sort(erased.begin(), erased.end());
    grid.Erase(erased);
    for (const Index3& index : erased) {
      expected.erase(index);
      std::erase(order, index);
      ASSERT_EQ(grid.Find(index), nullptr);
    }
    erasures += erased.size();
    ExpectSame(grid, expected, order);
    ExpectSame(BlockGrid<int>(grid), expected, order);
  }
  EXPECT_GT(erasures, 1000U);
}

// Neighbours may lie in other cells of the directory, on either side of zero.
TEST(BlockGrid, FindsTheUpperBlocks) {
  Dice dice(5);
  BlockGrid<int> grid;
  const auto any = [&] {
    return Index3{dice.Whole(14) - 7, dice.Whole(14) - 7, dice.Whole(14) - 7};
  };
  for (int i = 0; i < 900; ++i) grid.FindOrAdd(any()) = i;
  int found = 0;
  for (int i = 0; i < 500; ++i) {
    const Index3 index = any();
    const auto upper = grid.FindUpper(index);
    for (int step = 0; step < 8; ++step) {
      ASSERT_EQ(upper[static_cast<std::size_t>(step)],
                grid.Find(index + Index3{step & 1, (step >> 1) & 1, step >> 2}));
      if (upper[static_cast<std::size_t>(step)] != nullptr) ++found;
    }
  }
  EXPECT_GT(found, 500);
}

TEST(BlockGrid, ErasingAllLeavesNothing) {
  BlockGrid<int> grid;
  std::vector<Index3> all;
  for (int i = 0; i < 1000; ++i) {
    all.push_back({i, -i, 3 * i});
    grid.FindOrAdd(all.back()) = i;
  }
  const std::size_t table = grid.TableBytes();
  grid.Erase(all);
  EXPECT_TRUE(grid.empty());
  for (const Index3& index : all) EXPECT_EQ(grid.Find(index), nullptr);
  for (const Index3& index : all) grid.FindOrAdd(index) = 1;
  EXPECT_EQ(grid.TableBytes(), table);
}

// What is written to an object stays, whatever other threads take and give meanwhile.
TEST(ObjectPool, HandsOutNoPlaceTwice) {
  constexpr std::size_t kSize = 192;
  constexpr std::size_t kAlignment = 64;
  constexpr std::size_t kObjects = 30000;  // more than one chunk
  using Pool = ObjectPool<kSize, kAlignment>;
  const auto work = [](unsigned char mark) {
    Dice dice(mark);
    std::vector<unsigned char*> held;
    bool good = true;
    const auto give = [&](std::size_t i) {
      good = good && std::all_of(held[i], held[i] + kSize,
                                 [&](unsigned char byte) { return byte == mark; });
      Pool::Give(held[i]);
      held[i] = held.back();
      held.pop_back();
    };
    for (std::size_t i = 0; i < kObjects; ++i) {
      held.push_back(static_cast<unsigned char*>(Pool::Take()));
      good = good && reinterpret_cast<std::uintptr_t>(held.back()) % kAlignment == 0;
      std::fill_n(held.back(), kSize, mark);
      if (dice.Whole(3) == 0)
        give(static_cast<std::size_t>(dice.Whole(static_cast<int>(held.size()))));
    }
    while (!held.empty()) give(held.size() - 1);
    return good;
  };
  std::array<bool, 3> good{};
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < good.size(); ++t) {
    threads.emplace_back([&, t] { good[t] = work(static_cast<unsigned char>(t + 1)); });
  }
  for (std::thread& thread : threads) thread.join();
  for (const bool each : good) EXPECT_TRUE(each);
}

}  // namespace
}  // namespace tsdfpp
