#include "core/own_environment.h"

#include <cstring>

namespace tsdfpp {
namespace {

bool IsOf(const char* variable, const char* name) {
  const std::size_t length = std::strlen(name);
  return std::strncmp(variable, name, length) == 0 && variable[length] == '=';
}

}  // namespace

void TakeOutOwn(char** environment) {
  bool is_ours = false;
  for (char** from = environment; *from != nullptr; ++from) {
    is_ours = is_ours || IsOf(*from, kOwnOpenMpThreads);
  }
  if (!is_ours) return;
  char** to = environment;
  for (char** from = environment; *from != nullptr; ++from) {
    if (!IsOf(*from, kOwnOpenMpThreads) && !IsOf(*from, kOpenMpThreads)) *to++ = *from;
  }
  *to = nullptr;
}

}  // namespace tsdfpp
