// Image rows in parallel. Each call owns its row, so any number of threads gives the same bytes.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace tsdfpp {

template <typename RowFunction>
void ParallelRows(int rows, const RowFunction& row_function) {
  tbb::parallel_for(tbb::blocked_range<int>(0, rows), [&](const tbb::blocked_range<int>& range) {
    for (int row = range.begin(); row < range.end(); ++row) row_function(row);
  });
}

}  // namespace tsdfpp
