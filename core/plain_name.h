// Names that come from data and may become file names, checked where they enter.
#pragma once

#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

inline constexpr std::size_t kMostNameBytes = 100;

// A name that can be a file's own name on any system: 1 to 100 bytes of UTF-8 without / or \ and
// without control characters, no '.' or '-' in front, no '.' or blank at the end, no name of a
// device (CON, NUL, COM1, ..., with any ending). `what` begins the sentence, e.g.
// "x/sequence.json: object 3". Errors: kData, saying what is wrong with it.
Expected<void> CheckPlainName(std::string_view name, std::string_view what);

// Text that is shown and never a file's name, such as a class; it may be empty. At most 100 bytes
// of UTF-8 without control characters. Errors: kData.
Expected<void> CheckLabel(std::string_view label, std::string_view what);

// The objects of a sequence or a saved map: names as above, classes as labels, no name and no id
// twice, no object with the id that stands for none (65535). `where` begins the sentence. Errors:
// kData.
Expected<void> CheckObjects(const std::vector<ObjectInfo>& objects, std::string_view where);

}  // namespace tsdfpp
