// Looking up blocks that lie together.
#pragma once

#include "mapper/volume/block_grid.h"

namespace tsdfpp {

// Finds blocks of a grid that does not change meanwhile, the one found last at once.
template <typename Block>
class LastBlock {
 public:
  explicit LastBlock(const BlockGrid<Block>& grid) : grid_(&grid) {}

  const Block* Find(const Index3& index) {
    if (!is_known_ || index != index_) {
      index_ = index;
      block_ = grid_->Find(index);
      is_known_ = true;
    }
    return block_;
  }

 private:
  const BlockGrid<Block>* grid_;
  Index3 index_;
  const Block* block_ = nullptr;
  bool is_known_ = false;
};

}  // namespace tsdfpp
