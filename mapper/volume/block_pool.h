// Room for many objects of one size, side by side in large pages: a frame reads thousands of blocks
// here and there, and with ordinary pages it would wait for their addresses as often as for them.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <mutex>
#include <new>
#include <utility>

namespace tsdfpp {

// Takes memory from the system in chunks and keeps it for the next object of the size; any thread
// may take and give. Under sanitizers every object is allocated by itself, so that they see when
// one is used that has been freed.
template <std::size_t kSize, std::size_t kAlignment>
class ObjectPool {
 public:
  // From one object to the next. Were it a power of two, the same part of all objects would share a
  // few sets of the cache.
  static constexpr std::size_t kStride = kSize % 1024 == 0 ? kSize + kAlignment : kSize;

  static void* Take() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return ::operator new(kSize, std::align_val_t(kAlignment));
#else
    Shared& shared = State();
    const std::lock_guard lock(shared.mutex);
    if (shared.free == nullptr) AddChunk(shared);
    return std::exchange(shared.free, shared.free->next);
#endif
  }

  static void Give(void* object) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    ::operator delete(object, std::align_val_t(kAlignment));
#else
    if (object == nullptr) return;
    Shared& shared = State();
    const std::lock_guard lock(shared.mutex);
    shared.free = ::new (object) Place{shared.free};
#endif
  }

 private:
  static constexpr std::size_t kChunk = 2U << 20U;  // a large page of x86-64
  static_assert(kSize % kAlignment == 0 && kStride <= kChunk);

  struct Place {
    Place* next;
  };
  struct Shared {
    std::mutex mutex;
    Place* free = nullptr;
  };
  // Never destroyed: maps may outlive every other static object.
  static Shared& State() {
    static auto* shared = new Shared;
    return *shared;
  }
  static void AddChunk(Shared& shared) {
    auto* chunk = static_cast<std::byte*>(std::aligned_alloc(kChunk, kChunk));
    if (chunk == nullptr) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
    madvise(chunk, kChunk, MADV_HUGEPAGE);  // a wish: without it all is only slower
#endif
    for (std::size_t i = kChunk / kStride; i-- > 0;) {
      shared.free = ::new (chunk + i * kStride) Place{shared.free};
    }
  }
};

}  // namespace tsdfpp
