// Faults that a sanitizer must report, and the mapper's pattern of work without one, which it must
// not. Usage: planted_fault none|tasks|read|bytes|heap|freed|signed
#include <tbb/parallel_for.h>

#include <atomic>
#include <climits>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace {

// Two tasks on two threads at the same time; relaxed, so that their meeting orders nothing.
template <typename Body>
void OnTwoThreads(const Body& body) {
  std::atomic<int> arrived = 0;
  tbb::parallel_for(
      tbb::blocked_range<int>(0, 2, 1),
      [&](const tbb::blocked_range<int>& range) {
        arrived.fetch_add(1, std::memory_order_relaxed);
        while (arrived.load(std::memory_order_relaxed) < 2) std::this_thread::yield();
        body(range.begin());
      },
      tbb::simple_partitioner());
}

// What a loop of the mapper does: tasks read the caller's values and write to places of their own,
// which the caller reads afterwards; often, so that memory and tasks are used again.
int Clean() {
  std::vector<int> written(2);
  int right = 0;
  for (int i = 0; i < 1000; ++i) {
    const int read = i;
    OnTwoThreads([&](int task) { written[static_cast<std::size_t>(task)] = read + task; });
    right += written[0] == i && written[1] == i + 1 ? 1 : 0;
  }
  return right;
}

// ThreadSanitizer misses one race in ten where the threads of a busy machine are far apart.
constexpr int kRaces = 100;

// Two tasks write the same place.
int Tasks() {
  int shared = 0;
  for (int i = 0; i < kRaces; ++i) OnTwoThreads([&](int task) { shared = task; });
  return shared;
}

// One reads what the other writes.
int Read() {
  std::vector<int> written(2);
  for (int i = 0; i < kRaces; ++i) {
    OnTwoThreads([&](int task) {
      if (task == 0) written[0] = 1;
      if (task == 1) written[1] = written[0];
    });
  }
  return written[1];
}

// Neighbours that share a byte.
int Bytes() {
  std::vector<bool> seen(2);
  for (int i = 0; i < kRaces; ++i) {
    OnTwoThreads([&](int task) { seen[static_cast<std::size_t>(task)] = true; });
  }
  return seen[0] && seen[1] ? 1 : 0;
}

// One behind the end; the numbers are volatile so that the compiler does not see it first.
int Heap() {
  volatile std::size_t count = 3;
  const auto values = std::make_unique<int[]>(count);
  return values[count];
}

int Freed() {
  auto value = std::make_unique<volatile int>(1);
  volatile int* volatile left = value.get();
  value.reset();
  return *left;
}

int Signed() {
  volatile int most = INT_MAX;
  return most + 1;
}

}  // namespace

int main(int argc, char** argv) {
  const std::map<std::string, std::function<int()>> faults{
      {"none", Clean}, {"tasks", Tasks}, {"read", Read},    {"bytes", Bytes},
      {"heap", Heap},  {"freed", Freed}, {"signed", Signed}};
  const auto fault = faults.find(argc == 2 ? argv[1] : "");
  if (fault == faults.end()) {
    std::fprintf(stderr, "usage: planted_fault none|tasks|read|bytes|heap|freed|signed\n");
    return 2;
  }
  std::printf("%d\n", fault->second());
  return 0;
}
