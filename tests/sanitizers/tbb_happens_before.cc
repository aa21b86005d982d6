// What ThreadSanitizer cannot see of oneTBB: Debian's libtbb is not instrumented, so without this
// every task that another thread takes looks like a race with the thread that made it. The entry
// points of libtbb that the headers call are defined here, in front of its own; each tells the
// sanitizer the order that oneTBB guarantees, and no other, and calls the original:
// - what happened before a task was spawned happened before it runs (two tasks stay unordered);
// - what happened before the last reference of a wait was released happened before it ends;
// - memory of small objects comes from operator new, which the sanitizer knows.
// So no race has to be suppressed. For builds with -fsanitize=thread only
// (cmake/TsdfppTarget.cmake).
#include <dlfcn.h>
#include <oneapi/tbb/detail/_small_object_pool.h>
#include <oneapi/tbb/detail/_task.h>
#include <sanitizer/tsan_interface.h>

#include <cstdio>
#include <cstdlib>
#include <new>

namespace tbb::detail {
namespace {

// The function of libtbb that the one of this name and type here stands in front of.
template <typename Function>
Function* Original(const char* mangled_name) {
  void* address = dlsym(RTLD_NEXT, mangled_name);
  if (address == nullptr) {
    std::fprintf(stderr, "tbb_happens_before: libtbb has no %s\n", mangled_name);
    std::abort();
  }
  return reinterpret_cast<Function*>(address);
}

// Runs a task in its stead, after all that happened before it was spawned.
class OrderedTask : public d1::task {
 public:
  explicit OrderedTask(d1::task& inner) : inner_(inner) { __tsan_release(this); }

  d1::task* execute(d1::execution_data& data) override {
    return Finish([&] { return inner_.execute(data); });
  }
  d1::task* cancel(d1::execution_data& data) override {
    return Finish([&] { return inner_.cancel(data); });
  }

 private:
  template <typename Function>
  d1::task* Finish(const Function& function) {
    __tsan_acquire(this);
    d1::task* const next = function();
    delete this;
    return next;
  }

  d1::task& inner_;
};

// wait_context begins with its version; its count of references, an instrumented atomic that the
// last task releases, follows.
void AcquireReferences(d1::wait_context& context) {
  static_assert(sizeof(d1::wait_context) == 2 * sizeof(std::uint64_t));
  __tsan_acquire(reinterpret_cast<char*>(&context) + sizeof(std::uint64_t));
}

struct NoPool : d1::small_object_pool {};
NoPool no_pool;

void* Allocate(d1::small_object_pool*& pool, std::size_t bytes) {
  pool = &no_pool;
  return ::operator new (bytes, std::align_val_t{d1::task_alignment});
}
void Deallocate(void* memory) { ::operator delete (memory, std::align_val_t{d1::task_alignment}); }

}  // namespace

namespace r1 {

void spawn(d1::task& task, d1::task_group_context& context) {
  static auto* const original = Original<void(d1::task&, d1::task_group_context&)>(
      "_ZN3tbb6detail2r15spawnERNS0_2d14taskERNS2_18task_group_contextE");
  original(*new OrderedTask(task), context);
}

void spawn(d1::task& task, d1::task_group_context& context, d1::slot_id slot) {
  static auto* const original = Original<void(d1::task&, d1::task_group_context&, d1::slot_id)>(
      "_ZN3tbb6detail2r15spawnERNS0_2d14taskERNS2_18task_group_contextEt");
  original(*new OrderedTask(task), context, slot);
}

void execute_and_wait(d1::task& task, d1::task_group_context& task_context, d1::wait_context& wait,
                      d1::task_group_context& wait_context) {
  static auto* const original = Original<void(d1::task&, d1::task_group_context&, d1::wait_context&,
                                              d1::task_group_context&)>(
      "_ZN3tbb6detail2r116execute_and_waitERNS0_2d14taskERNS2_18task_group_contextERNS2_"
      "12wait_contextES6_");
  original(task, task_context, wait, wait_context);
  AcquireReferences(wait);
}

void wait(d1::wait_context& wait, d1::task_group_context& context) {
  static auto* const original = Original<void(d1::wait_context&, d1::task_group_context&)>(
      "_ZN3tbb6detail2r14waitERNS0_2d112wait_contextERNS2_18task_group_contextE");
  original(wait, context);
  AcquireReferences(wait);
}

void* allocate(d1::small_object_pool*& pool, std::size_t bytes, const d1::execution_data&) {
  return Allocate(pool, bytes);
}
void* allocate(d1::small_object_pool*& pool, std::size_t bytes) { return Allocate(pool, bytes); }
void deallocate(d1::small_object_pool&, void* memory, std::size_t, const d1::execution_data&) {
  Deallocate(memory);
}
void deallocate(d1::small_object_pool&, void* memory, std::size_t) { Deallocate(memory); }

}  // namespace r1
}  // namespace tbb::detail
