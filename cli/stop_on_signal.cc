#include "cli/stop_on_signal.h"

#include "core/guard.h"

namespace tsdfpp {
namespace {

std::atomic<bool> stop_asked{false};
std::atomic<int> stop_signal{0};

void OnSignal(int signal) {
  stop_signal = signal;
  stop_asked = true;
}

}  // namespace

StopOnSignal::StopOnSignal() {
  struct sigaction action {};
  action.sa_handler = OnSignal;
  action.sa_flags = SA_RESETHAND;  // and no SA_RESTART: waiting ends
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], nullptr, &before_[i]);
    // Who called this ignores it, as of what runs in the background, and so does this.
    if (before_[i].sa_handler != SIG_IGN) sigaction(kSignals[i], &action, nullptr);
  }
}

StopOnSignal::~StopOnSignal() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
}

const std::atomic<bool>& StopOnSignal::stop() { return stop_asked; }

void StopOnSignal::Die(const Error& error) {
  PrintError("tsdfpp", error.message);
  std::raise(stop_signal);
}

}  // namespace tsdfpp
