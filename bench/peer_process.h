// Open3D's volumes in a process of its own, which integrates some frames each time it is told to.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct PeerTimes {
  std::string name;
  std::size_t bytes = 0;   // occupied by now
  std::vector<double> ms;  // of the frames just integrated, those that warm up left out
};

// How OpenMP's threads wait: asleep, or spinning, which is faster where the cores are free.
enum class OpenMpWait { kPassive, kActive };

class PeerProcess {
 public:
  // Starts this program again as `tsdfpp_bench peers` with these further arguments, with OpenMP
  // threads as told. kEnvironment where that cannot be done.
  static Expected<std::unique_ptr<PeerProcess>> Start(const std::vector<std::string>& arguments,
                                                      OpenMpWait wait, int threads);
  ~PeerProcess();  // ends it

  // Lets it integrate its next frames and waits for that; a line for each volume. Between two calls
  // it is stopped, for threads that spin would take the cores from whoever comes next. kEnvironment
  // where it fails.
  Expected<std::vector<PeerTimes>> IntegrateNext();

 private:
  PeerProcess() = default;

  pid_t process_ = -1;
  std::FILE* to_ = nullptr;
  std::FILE* from_ = nullptr;
};

// The other end, in that process: what it says of a volume, the end of a turn, and waiting for the
// next, where false means that there is none.
void SayPeerTimes(const PeerTimes& times);
void EndPeerTurn();
bool AwaitPeerTurn();

}  // namespace tsdfpp
