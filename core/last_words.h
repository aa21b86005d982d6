// What a process says that dies of what nobody can catch: an exception in a destructor, a thread or
// an initialiser; a library without memory, which jumps to nowhere or aborts.
#pragma once

namespace tsdfpp {

// Of a program whose main() is GuardedMain(), from before the initialisers of its libraries on: an
// exception that nobody catches is said in a line, and so are SIGSEGV, SIGBUS and SIGABRT where
// IsOutOfAddressSpace(), which then end the process with the exit code of kEnvironment. Elsewhere
// they are what they always were. Signals are left to sanitizers, which say more.
void HandleLastWords();

// The name before the sentence, a literal; nullptr: says nothing, as the parent of a worker does.
void SpeakAs(const char* program);

}  // namespace tsdfpp
