#include "core/last_words.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <string_view>

#include "core/address_space.h"
#include "core/guard.h"

namespace tsdfpp {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
#else
constexpr bool kSanitized = false;
#endif

std::atomic<const char*> program_name = "tsdfpp";

void WriteAll(std::string_view text) {
  while (!text.empty()) {
    const ssize_t count = write(StderrDescriptor(), text.data(), text.size());
    if (count <= 0) return;
    text.remove_prefix(static_cast<std::size_t>(count));
  }
}

// Async-signal-safe.
[[noreturn]] void EndWithoutMemory(std::string_view why) {
  const char* const program = program_name;
  if (program != nullptr) {
    WriteAll(program);
    WriteAll(": out of memory: what was asked for needs more than there is");
    WriteAll(why);
    WriteAll("\n");
  }
  _exit(static_cast<int>(ErrorKind::kEnvironment));
}

void OnSignal(int signal) {
  if (IsOutOfAddressSpace()) EndWithoutMemory(" (its address space is limited and used up)");
  std::signal(signal, SIG_DFL);
  raise(signal);  // delivered when this returns
}

[[noreturn]] void OnTerminate() {
  if (std::current_exception()) {
    try {
      std::rethrow_exception(std::current_exception());
    } catch (const std::bad_alloc&) {
      EndWithoutMemory("");
    } catch (...) {
      const Error error = ErrorOfException();
      if (const char* const program = program_name) PrintError(program, error.message);
      if (error.kind == ErrorKind::kEnvironment) _exit(static_cast<int>(error.kind));
    }
  }
  // What was to be said has been.
  std::signal(SIGABRT, SIG_DFL);
  std::abort();
}

// The stack may be what could not grow.
alignas(16) std::array<char, 64 * 1024> signal_stack;

void BeforeAll(int /*argc*/, char** /*argv*/, char** /*environment*/) { HandleLastWords(); }

// Run by the loader before any library's initialisers, which allocate.
[[gnu::section(".preinit_array"), gnu::used]] void (*const kBeforeAll)(int, char**,
                                                                       char**) = BeforeAll;

}  // namespace

void HandleLastWords() {
  std::set_terminate(OnTerminate);
  if (kSanitized) return;
  stack_t stack{};
  stack.ss_sp = signal_stack.data();
  stack.ss_size = signal_stack.size();
  sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_handler = OnSignal;
  action.sa_flags = SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT}) sigaction(signal, &action, nullptr);
}

void SpeakAs(const char* program) { program_name = program; }

}  // namespace tsdfpp
