#include "mapper/associate/new_surface.h"

#include <algorithm>
#include <cstdint>
#include <optional>

namespace tsdfpp {
namespace {

// Cells are joined to parts of an object in cubes of so many.
constexpr int kCoarse = 4;

Index3 CoarseOf(const Index3& cell) {
  const auto divide = [](int x) { return x >= 0 ? x / kCoarse : -((kCoarse - 1 - x) / kCoarse); };
  return {divide(cell.x), divide(cell.y), divide(cell.z)};
}

void SortOnce(std::vector<Index3>& cells) {
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
}

// The cells that neighbours (26 each) connect to most of them, sorted; of as many the first.
std::vector<Index3> LargestPart(std::vector<Index3> cells) {
  SortOnce(cells);
  std::vector<bool> is_taken(cells.size());
  std::vector<Index3> largest;
  for (std::size_t first = 0; first < cells.size(); ++first) {
    if (is_taken[first]) continue;
    is_taken[first] = true;
    std::vector<Index3> part{cells[first]};
    for (std::size_t i = 0; i < part.size(); ++i) {
      for (int n = 0; n < 27; ++n) {
        const Index3 next = part[i] + Index3{n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
        const auto found = std::lower_bound(cells.begin(), cells.end(), next);
        if (found == cells.end() || *found != next) continue;
        const auto place = static_cast<std::size_t>(found - cells.begin());
        if (is_taken[place]) continue;
        is_taken[place] = true;
        part.push_back(next);
      }
    }
    if (part.size() > largest.size()) largest = std::move(part);
  }
  std::sort(largest.begin(), largest.end());
  return largest;
}

}  // namespace

// What an object that has no surface yet would begin with.
class NewSurface::Body {
 public:
  Body(const std::vector<Index3>& seen, const NewSurface& surface, InstanceId label) {
    const Counted& counted = surface.counted_.at(label);
    std::vector<Index3> confirmed;
    std::vector<Index3> all;
    for (const Index3& cell : seen) {
      all.push_back(CoarseOf(cell));
      if (FramesOf(counted, cell) >= surface.confirm_frames_) confirmed.push_back(all.back());
    }
    const auto labelled = surface.labelled_.find(label);
    moves_ = labelled->second.frames >= surface.birth_frames_ && 2 * confirmed.size() < seen.size();
    part_ = LargestPart(moves_ ? std::move(all) : std::move(confirmed));
  }
  bool Has(const Index3& cell, bool is_confirmed) const {
    return (is_confirmed || moves_) &&
           std::binary_search(part_.begin(), part_.end(), CoarseOf(cell));
  }

 private:
  bool moves_ = false;
  std::vector<Index3> part_;  // coarse, sorted
};

void NewSurface::Count(const std::vector<Index3>& seen, Counted& counted) const {
  Counted next;
  next.reserve(counted.size() + seen.size());
  const auto is_kept = [this](const Sightings& sightings) {
    return frame_ - sightings.last <= forget_frames_;
  };
  auto known = counted.cbegin();
  const auto keep_until = [&](const Index3* cell) {
    for (; known != counted.cend() && (cell == nullptr || known->cell < *cell); ++known) {
      if (is_kept(*known)) next.push_back(*known);
    }
  };
  for (const Index3& cell : seen) {
    keep_until(&cell);
    Sightings sightings{cell, 1, frame_};
    if (known != counted.cend() && known->cell == cell) {
      if (is_kept(*known)) sightings.frames += known->frames;
      ++known;
    }
    next.push_back(sightings);
  }
  keep_until(nullptr);
  counted = std::move(next);
}

int NewSurface::FramesOf(const Counted& counted, const Index3& cell) {
  const auto found = std::lower_bound(
      counted.cbegin(), counted.cend(), cell,
      [](const Sightings& sightings, const Index3& of) { return sightings.cell < of; });
  return found != counted.cend() && found->cell == cell ? found->frames : 0;
}

std::vector<bool> NewSurface::Confirm(std::span<const NewPoint> points, const ObjectCells& cells,
                                      const ObjectLookup& lookup) {
  ++frame_;
  std::vector<std::optional<Index3>> cell_of(points.size());
  std::map<InstanceId, std::vector<Index3>> seen;
  for (std::size_t i = 0; i < points.size(); ++i) {
    cell_of[i] = cells.CellOf(points[i].label, points[i].p_W);
    if (cell_of[i]) seen[points[i].label].push_back(*cell_of[i]);
  }
  // Of objects that have no surface yet.
  std::map<InstanceId, Body> bodies;
  for (auto& [label, of_label] : seen) {
    SortOnce(of_label);
    Counted& counted = counted_[label];
    Count(of_label, counted);
    if (label == kBackground || lookup.NumberOf(label)) continue;
    Sightings& label_seen = labelled_[label];
    if (frame_ - label_seen.last > forget_frames_) label_seen.frames = 0;
    ++label_seen.frames;
    label_seen.last = frame_;
    bodies.emplace(label, Body(of_label, *this, label));
  }
  std::vector<bool> is_confirmed(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const InstanceId label = points[i].label;
    // Farther out than any voxel: the map refuses it.
    if (!cell_of[i]) continue;
    const int frames = FramesOf(counted_.at(label), *cell_of[i]);
    is_confirmed[i] = frames >= confirm_frames_;
    if (label == kBackground || frames >= kTimesLongerApart * confirm_frames_) continue;
    if (const auto body = bodies.find(label); body != bodies.end()) {
      is_confirmed[i] = body->second.Has(*cell_of[i], is_confirmed[i]);
    } else if (is_confirmed[i]) {
      is_confirmed[i] = lookup.HasSurfaceAround(*lookup.NumberOf(label), points[i].p_W);
    }
  }
  return is_confirmed;
}

}  // namespace tsdfpp
