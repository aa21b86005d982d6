// What no reader may do short of crashing: a complaint ends the process with its sentence, which a
// fuzzer keeps as a find.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"

namespace tsdfpp::fuzz {

// Ends the process unless `holds`.
void Require(bool holds, std::string_view sentence);

// What is wrong with an error as a user would see it; nothing where it keeps the rules: it is not
// the program's own fault, and printed it is one line of text without control characters, under 500
// bytes. It has to hold `named`, e.g. the name of the file.
std::optional<std::string> FaultOf(const Error& error, std::string_view named);

// Whether there is a value; else its error must be without fault.
template <typename T>
bool Accepted(const Expected<T>& read, std::string_view named = {}) {
  if (read) return true;
  const auto fault = FaultOf(read.error(), named);
  Require(!fault, fault.value_or(""));
  return false;
}

}  // namespace tsdfpp::fuzz
