// Which blocks of an index changed lately, for any number of readers, each of which remembers how
// far it has read.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "mapper/volume/block_grid.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// A copy is another log, of which nobody has read anything.
class ChangeLog {
 public:
  // Where a reader stopped. As it is made, it has read nothing.
  struct Mark {
    std::uint64_t log = 0;
    std::uint64_t read = 0;
  };

  ChangeLog() = default;
  ChangeLog(const ChangeLog&) {}
  ChangeLog& operator=(const ChangeLog&) {
    NoteAll();
    return *this;
  }
  ~ChangeLog() = default;

  void Note(const Index3& block) {
    if (last_.size() < kMost) {
      last_.push_back(block);
    } else {
      last_[noted_ % kMost] = block;
    }
    ++noted_;
  }
  // Any block may have changed.
  void NoteAll() {
    log_ = NewRevision();
    noted_ = 0;
    last_.clear();
  }

  // The blocks noted since the reader's mark, which moves to the end; nothing where that may be
  // any block: the mark is another log's, or too many were noted since.
  std::optional<std::vector<Index3>> ReadFrom(Mark& mark) const {
    const Mark from = std::exchange(mark, {log_, noted_});
    if (from.log != log_ || noted_ - from.read > last_.size()) return std::nullopt;
    std::vector<Index3> blocks;
    for (std::uint64_t i = from.read; i != noted_; ++i) blocks.push_back(last_[i % kMost]);
    return blocks;
  }

 private:
  // So many that a reader had better not tell them apart.
  static constexpr std::size_t kMost = 4096;

  std::uint64_t log_ = NewRevision();
  std::uint64_t noted_ = 0;
  std::vector<Index3> last_;  // the number `noted_ - 1` at that number modulo kMost
};

}  // namespace tsdfpp
