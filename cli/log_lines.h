// The log on stderr.
#pragma once

namespace tsdfpp {

// Makes a default logger that prints each message to stderr as "<level>: <message>": one line,
// whatever text from outside is in it, under 500 bytes; also while a QuietStderr
// (core/quiet_stderr.h) keeps what others print from it.
void LogOneLineEach();

}  // namespace tsdfpp
