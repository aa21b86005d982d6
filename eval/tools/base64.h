// Bytes as text for a page (RFC 4648, with padding).
#pragma once

#include <string>
#include <string_view>

namespace tsdfpp {

std::string Base64(std::string_view bytes);

}  // namespace tsdfpp
