// What libFuzzer calls, for the target that the environment variable TSDFPP_FUZZ_TARGET names.
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "tests/fuzz/mutate.h"
#include "tests/fuzz/target.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size,
                                        std::size_t most_bytes);

namespace tsdfpp::fuzz {
namespace {

const Target& Chosen() {
  static const Target& chosen = []() -> const Target& {
    const char* const name = std::getenv("TSDFPP_FUZZ_TARGET");
    const Target* const target = name != nullptr ? FindTarget(name) : nullptr;
    if (target == nullptr) {
      std::fprintf(stderr, "TSDFPP_FUZZ_TARGET is '%s', expected one of:\n",
                   name != nullptr ? name : "");
      for (const Target& known : AllTargets()) {
        std::fprintf(stderr, "%.*s\n", static_cast<int>(known.name.size()), known.name.data());
      }
      std::exit(2);
    }
    // An input is read the same way each time.
    static const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    PrepareTargets();
    return *target;
  }();
  return chosen;
}

Mutator MutatorOf(std::uint32_t seed) {
  return {seed, [](const std::string& bytes) {
            // May grow by half and a little.
            std::string changed = bytes;
            changed.resize(bytes.size() + bytes.size() / 2 + 16);
            changed.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(changed.data()),
                                            bytes.size(), changed.size()));
            return changed;
          }};
}

std::string_view TextOf(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace
}  // namespace tsdfpp::fuzz

using namespace tsdfpp::fuzz;

extern "C" int LLVMFuzzerInitialize(int* /*argc*/, char*** /*argv*/) {
  Chosen();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Chosen().read(TextOf(data, size));
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most_bytes, unsigned int seed) {
  const Target& target = Chosen();
  Mutator mutator = MutatorOf(seed);
  const std::string_view input = TextOf(data, size);
  const std::string changed = target.file.empty()
                                  ? mutator.ChangeSet(input)
                                  : mutator.ChangeFile(target.file, std::string(input));
  // What has grown too long would lose its form.
  if (changed.size() > most_bytes) return LLVMFuzzerMutate(data, size, most_bytes);
  std::memcpy(data, changed.data(), changed.size());
  return changed.size();
}

extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* first, std::size_t first_size,
                                                 const std::uint8_t* second,
                                                 std::size_t second_size, std::uint8_t* out,
                                                 std::size_t most_bytes, unsigned int seed) {
  if (!Chosen().file.empty()) return 0;
  const std::string crossed =
      MutatorOf(seed).CrossSets(TextOf(first, first_size), TextOf(second, second_size));
  if (crossed.size() > most_bytes) return 0;
  std::memcpy(out, crossed.data(), crossed.size());
  return crossed.size();
}
