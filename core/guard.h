// The end of the line for exceptions: the project throws none, but for std::bad_alloc where a C
// library has no memory; its libraries do.
#pragma once

#include <functional>
#include <string_view>
#include <type_traits>

#include "core/error.h"

namespace tsdfpp {

// What is being handled, as an error; to be called within catch (...). Memory and files are the
// environment's (kEnvironment), and so is what a library throws where address space is limited and
// used up; everything else is a fault of the program (kInternal).
Error ErrorOfException();

// What `function` returns, an Expected, or the error of what it throws.
template <typename Function>
std::invoke_result_t<const Function&> Guarded(const Function& function) {
  try {
    return function();
  } catch (...) {
    return tl::unexpected(ErrorOfException());
  }
}

// Where stderr leads, also while a QuietStderr (core/quiet_stderr.h) keeps others' words from it.
int StderrDescriptor();
void SetStderrDescriptor(int descriptor);

// "<program>: <message>" on stderr: one line without control bytes, under 500 bytes.
void PrintError(std::string_view program, std::string_view message);

// The whole of a main(): opens what is closed of stdin, stdout and stderr, so that no file gets
// their numbers, takes the limits from the environment (core/limits.h), runs `body`, which returns
// the exit code, and turns what is thrown into a sentence and its exit code. `program` is a
// literal. What cannot be caught is said too (core/last_words.h).
int GuardedMain(const char* program, const std::function<int()>& body);

}  // namespace tsdfpp
