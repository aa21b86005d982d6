// What is a function of a map and made when it is first read, by whichever thread that is.
#pragma once

#include <tbb/task_arena.h>

#include <atomic>
#include <mutex>

namespace tsdfpp {

// Guards something derived: whoever changes what it is made from says so by Outdate(), alone;
// readers, any number at once, call Run() before they read.
class RefreshOnce {
 public:
  RefreshOnce() = default;
  // Nobody must be refreshing the other.
  RefreshOnce(const RefreshOnce& other) : is_outdated_(other.is_outdated_.load()) {}
  RefreshOnce& operator=(const RefreshOnce& other) {
    is_outdated_ = other.is_outdated_.load();
    return *this;
  }
  ~RefreshOnce() = default;

  void Outdate() { is_outdated_.store(true, std::memory_order_relaxed); }

  // Calls refresh() if it has not been called since the last Outdate(); returns when it is done,
  // whoever did it.
  template <typename Function>
  void Run(const Function& refresh) const {
    if (!is_outdated_.load(std::memory_order_acquire)) return;
    // A thread that waits for the refresh's own tasks must not take up another one, which might
    // want the lock that it holds.
    tbb::this_task_arena::isolate([&] {
      const std::lock_guard lock(mutex_);
      if (!is_outdated_.load(std::memory_order_relaxed)) return;
      refresh();
      is_outdated_.store(false, std::memory_order_release);
    });
  }

  // What `read` returns, while nobody refreshes; of what is derived as it happens to be.
  template <typename Function>
  auto Alone(const Function& read) const {
    const std::lock_guard lock(mutex_);
    return read();
  }

 private:
  mutable std::atomic<bool> is_outdated_ = true;
  mutable std::mutex mutex_;
};

}  // namespace tsdfpp
