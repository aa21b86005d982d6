#include "cli/stop_on_signal.h"

#include <csignal>

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
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
}

StopOnSignal::~StopOnSignal() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
}

const std::atomic<bool>& StopOnSignal::stop() { return stop_asked; }

void StopOnSignal::Die(const Error& error) {
  PrintError("tsdfpp", error.message);
  std::raise(stop_signal);
}

}  // namespace tsdfpp
