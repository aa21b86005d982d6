#include "mapper/network/own_network.h"

#include <cstddef>

// The file's bytes, between two labels.
__asm__(
    ".section .rodata\n"
    ".global tsdfpp_own_network\n"
    "tsdfpp_own_network:\n"
    ".incbin \"" TSDFPP_OWN_NETWORK
    "\"\n"
    ".global tsdfpp_own_network_end\n"
    "tsdfpp_own_network_end:\n"
    ".byte 0\n"
    ".previous\n");

extern "C" {
extern const unsigned char tsdfpp_own_network[];
extern const unsigned char tsdfpp_own_network_end[];
}

namespace tsdfpp {

std::span<const unsigned char> OwnNetworkFile() {
  return {tsdfpp_own_network,
          static_cast<std::size_t>(tsdfpp_own_network_end - tsdfpp_own_network)};
}

}  // namespace tsdfpp
