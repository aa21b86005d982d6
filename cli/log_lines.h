// The log on stderr.
#pragma once

namespace tsdfpp {

// Makes the default logger print each message as "<level>: <message>": one line, whatever text from
// outside is in it, under 500 bytes.
void LogOneLineEach();

}  // namespace tsdfpp
