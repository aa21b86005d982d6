#include "mapper/associate/contested_cells.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace tsdfpp {
namespace {

constexpr std::int64_t kOwnPart = 8;

}  // namespace

bool IsOfLowerCell(const Testimony& a, const Testimony& b) {
  return a.object == b.object ? a.cell < b.cell : a.object < b.object;
}

ContestedCells::Cells::const_iterator ContestedCells::PlaceIn(const Cells& cells,
                                                              const Index3& cell) {
  return std::lower_bound(cells.begin(), cells.end(), cell,
                          [](const Cell& known, const Index3& of) { return known.cell < of; });
}

const ContestedCells::Cell* ContestedCells::Find(InstanceId object, const Index3& cell) const {
  const auto cells = cells_.find(object);
  if (cells == cells_.end()) return nullptr;
  const auto place = PlaceIn(cells->second, cell);
  return place != cells->second.end() && place->cell == cell ? &*place : nullptr;
}

bool ContestedCells::IsContested(InstanceId object, const Index3& cell) const {
  return Find(object, cell) != nullptr;
}

double ContestedCells::ShareOf(InstanceId object, const Index3& cell) const {
  const Cell* found = Find(object, cell);
  return found == nullptr ? 1 : double{found->own} / (found->own + found->other);
}

void ContestedCells::Add(std::vector<Testimony> said) {
  std::sort(said.begin(), said.end(), IsOfLowerCell);
  std::map<InstanceId, Cells> first_disputed;
  for (std::size_t i = 0; i < said.size();) {
    const Testimony& first = said[i];
    std::int64_t own = 0;
    std::int64_t all = 0;
    float observations = 0;
    for (; i < said.size() && !IsOfLowerCell(first, said[i]); ++i) {
      own += said[i].is_own ? 1 : 0;
      ++all;
      observations = std::max(observations, said[i].observations);
    }
    const bool is_own = kOwnPart * own >= all;
    if (Find(first.object, first.cell) != nullptr) {
      Cells& cells = cells_.at(first.object);
      Cell& cell = cells[static_cast<std::size_t>(PlaceIn(cells, first.cell) - cells.begin())];
      (is_own ? cell.own : cell.other) += 1;
    } else if (!is_own) {
      first_disputed[first.object].push_back({first.cell, observations, 1});
    }
  }
  for (const auto& [object, cells] : first_disputed) {
    Cells& known = cells_[object];
    const auto middle = static_cast<std::ptrdiff_t>(known.size());
    known.insert(known.end(), cells.begin(), cells.end());
    std::inplace_merge(known.begin(), known.begin() + middle, known.end(),
                       [](const Cell& a, const Cell& b) { return a.cell < b.cell; });
  }
}

std::map<InstanceId, std::vector<Index3>> ContestedCells::TakeLost() {
  const auto is_lost = [](const Cell& cell) { return cell.other > cell.own; };
  std::map<InstanceId, std::vector<Index3>> lost;
  for (auto& [object, cells] : cells_) {
    if (object == kBackground) continue;
    for (const Cell& cell : cells) {
      if (is_lost(cell)) lost[object].push_back(cell.cell);
    }
    std::erase_if(cells, is_lost);
  }
  return lost;
}

}  // namespace tsdfpp
