#include "mapper/segment/components.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "mapper/segment/pixel_rays.h"

namespace tsdfpp {
namespace {

// Neighbouring members of a row that are connected.
struct RunOfPixels {
  int begin = 0;
  int end = 0;
};

std::vector<RunOfPixels> RunsOf(const std::uint8_t* member, const std::uint8_t* right, int cols) {
  std::vector<RunOfPixels> runs;
  for (int u = 0; u < cols; ++u) {
    if (member[u] == 0) continue;
    const int begin = u;
    while (u + 1 < cols && member[u + 1] != 0 && right[u] != 0) ++u;
    runs.push_back({begin, u + 1});
  }
  return runs;
}

// Sets of numbers, each named by its least.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  std::int32_t Find(std::int32_t i) {
    while (parent_[static_cast<std::size_t>(i)] != i) {
      std::int32_t& parent = parent_[static_cast<std::size_t>(i)];
      parent = parent_[static_cast<std::size_t>(parent)];
      i = parent;
    }
    return i;
  }
  void Join(std::int32_t a, std::int32_t b) {
    a = Find(a);
    b = Find(b);
    parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<std::int32_t> parent_;
};

// Joins the runs of a row with those of the row below that links lead to.
void JoinRows(const std::vector<RunOfPixels>& upper, std::int32_t first_upper,
              const std::vector<RunOfPixels>& lower, std::int32_t first_lower,
              const std::uint8_t* down, DisjointSets& sets) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < upper.size() && j < lower.size()) {
    const int begin = std::max(upper[i].begin, lower[j].begin);
    const int end = std::min(upper[i].end, lower[j].end);
    if (begin < end && std::any_of(down + begin, down + end, [](auto link) { return link != 0; })) {
      sets.Join(first_upper + static_cast<std::int32_t>(i),
                first_lower + static_cast<std::int32_t>(j));
    }
    upper[i].end < lower[j].end ? ++i : ++j;
  }
}

using LabelPair = std::pair<std::int32_t, std::int32_t>;  // the lower first

// Parts, of which small ones are joined to others.
class Joining {
 public:
  Joining(const PartSize& least, std::vector<PartSize> sizes)
      : least_(least), sizes_(std::move(sizes)), becomes_(sizes_.size()) {
    std::iota(becomes_.begin(), becomes_.end(), 0);
  }

  // The links of each small part to others.
  void CountLinks(const PixelLinks& links, const cv::Mat& labels) {
    std::array<std::vector<LabelPair>, kRowStrips> pairs;
    ForEachStrip(labels.rows, [&](std::size_t strip, int first, int last) {
      for (int v = first; v < last; ++v) {
        const auto* row = labels.ptr<std::int32_t>(v);
        const auto* right = links.right.ptr<std::uint8_t>(v);
        for (int u = 0; u + 1 < labels.cols; ++u) {
          if (row[u] != row[u + 1] && right[u] != 0) AddPair(row[u], row[u + 1], pairs[strip]);
        }
        if (v + 1 == labels.rows) break;
        const auto* below = labels.ptr<std::int32_t>(v + 1);
        const auto* down = links.down.ptr<std::uint8_t>(v);
        for (int u = 0; u < labels.cols; ++u) {
          if (row[u] != below[u] && down[u] != 0) AddPair(row[u], below[u], pairs[strip]);
        }
      }
      std::sort(pairs[strip].begin(), pairs[strip].end());
    });
    for (const auto& of_strip : pairs) {
      for (auto begin = of_strip.begin(); begin != of_strip.end();) {
        const auto end = std::find_if(begin, of_strip.end(), [&](auto& p) { return p != *begin; });
        const auto count = static_cast<int>(end - begin);
        shared_[begin->first][begin->second] += count;
        shared_[begin->second][begin->first] += count;
        begin = end;
      }
    }
  }

  // The smallest first, each to the part with which it has most links, until none is small; what
  // has links to nobody is dropped.
  void JoinAll() {
    std::set<std::pair<std::int64_t, std::int32_t>> small;  // pixels, label
    for (std::int32_t label = 1; label < end(); ++label) {
      if (!IsSmall(label)) continue;
      if (shared_.contains(label)) {
        small.emplace(SizeOf(label).pixels, label);
      } else {
        Becomes(label) = 0;
      }
    }
    while (!small.empty()) {
      const std::int32_t label = small.begin()->second;
      small.erase(small.begin());
      const std::int32_t into = MostLinked(label);
      Becomes(label) = into;
      if (into == 0) continue;
      small.erase({SizeOf(into).pixels, into});
      SizeOf(into).pixels += SizeOf(label).pixels;
      SizeOf(into).area_m2 += SizeOf(label).area_m2;
      if (IsSmall(into)) small.emplace(SizeOf(into).pixels, into);
      HandLinksOver(label, into);
    }
  }

  // What each label becomes, with numbers from `first` on for the parts that are left; 0 for what
  // was dropped. Moves `first` behind the last one.
  std::vector<std::int32_t> NumberParts(std::int32_t& first) const {
    std::vector<std::int32_t> number(sizes_.size());
    for (std::int32_t label = 1; label < end(); ++label) {
      const auto i = static_cast<std::size_t>(label);
      if (becomes_[i] == label && sizes_[i].pixels > 0) number[i] = first++;
    }
    std::vector<std::int32_t> number_of(sizes_.size());
    for (std::int32_t label = 0; label < end(); ++label) {
      number_of[static_cast<std::size_t>(label)] = number[static_cast<std::size_t>(LastOf(label))];
    }
    return number_of;
  }

 private:
  std::int32_t end() const { return static_cast<std::int32_t>(sizes_.size()); }
  PartSize& SizeOf(std::int32_t label) { return sizes_[static_cast<std::size_t>(label)]; }
  std::int32_t& Becomes(std::int32_t label) { return becomes_[static_cast<std::size_t>(label)]; }
  bool IsSmall(std::int32_t label) const {
    const PartSize& size = sizes_[static_cast<std::size_t>(label)];
    return size.pixels > 0 && (size.pixels < least_.pixels || size.area_m2 < least_.area_m2);
  }
  void AddPair(std::int32_t a, std::int32_t b, std::vector<LabelPair>& pairs) const {
    if (a == 0 || b == 0 || !(IsSmall(a) || IsSmall(b))) return;
    pairs.emplace_back(std::min(a, b), std::max(a, b));
  }
  // 0 where all its neighbours were joined to others.
  std::int32_t MostLinked(std::int32_t label) {
    std::int32_t into = 0;
    int most = 0;
    for (const auto& [other, number] : shared_[label]) {
      if (number > most) {
        most = number;
        into = other;
      }
    }
    return into;
  }
  void HandLinksOver(std::int32_t label, std::int32_t into) {
    for (const auto& [other, number] : shared_[label]) {
      shared_[other].erase(label);
      if (other == into) continue;
      shared_[other][into] += number;
      shared_[into][other] += number;
    }
    shared_.erase(label);
  }
  std::int32_t LastOf(std::int32_t label) const {
    while (becomes_[static_cast<std::size_t>(label)] != label) {
      label = becomes_[static_cast<std::size_t>(label)];
    }
    return label;
  }

  const PartSize& least_;
  std::vector<PartSize> sizes_;        // by label
  std::vector<std::int32_t> becomes_;  // by label: itself, or what it was joined to
  std::map<std::int32_t, std::map<std::int32_t, int>> shared_;
};

// Neighbours in a row with the same label, and the sum of their depths' squares.
struct RunOfLabel {
  std::int32_t label = 0;
  std::int32_t pixels = 0;
  float squares = 0;
};

// Calls of_run(run) for each, in order of rows. Without `depth` sums are 0.
template <typename OfRun>
void ForEachRunOfLabel(const cv::Mat& labels, const cv::Mat& depth, const OfRun& of_run) {
  std::array<std::vector<RunOfLabel>, kRowStrips> runs;
  ForEachStrip(labels.rows, [&](std::size_t strip, int first, int last) {
    for (int v = first; v < last; ++v) {
      const auto* row = labels.ptr<std::int32_t>(v);
      const auto* z = depth.empty() ? nullptr : depth.ptr<float>(v);
      for (int begin = 0; begin < labels.cols;) {
        int end = begin + 1;
        while (end < labels.cols && row[end] == row[begin]) ++end;
        float squares = 0;
        for (int u = begin; z != nullptr && u < end; ++u) squares += z[u] * z[u];
        runs[strip].push_back({row[begin], end - begin, squares});
        begin = end;
      }
    }
  });
  for (const auto& of_strip : runs) std::for_each(of_strip.begin(), of_strip.end(), of_run);
}

void AddWhereLinked(const std::uint8_t* link, const std::uint8_t* what, int count,
                    std::uint8_t* to) {
  for (int i = 0; i < count; ++i) {
    const int all_bits = -static_cast<int>(link[i] != 0);
    to[i] = static_cast<std::uint8_t>(to[i] | (all_bits & what[i]));
  }
}

// The labelled pixels with links to ones that get a label, in order of rows.
std::vector<int> OutermostOf(const cv::Mat& known, const PixelLinks& links, const cv::Mat& labels,
                             cv::Mat& open) {
  const int rows = labels.rows;
  const int cols = labels.cols;
  const auto width = static_cast<std::size_t>(cols);
  open.create(labels.size(), CV_8UC1);  // 1 where a label is missing, 2 where there is one
  ForEachRow(rows, [&](int v) {
    const auto* q = known.ptr<float>(v);
    const auto* label = labels.ptr<std::int32_t>(v);
    auto* to = open.ptr<std::uint8_t>(v);
    for (int u = 0; u < cols; ++u) {
      const int missing = static_cast<int>(label[u] == 0) & static_cast<int>(q[u] != 0);
      to[u] = static_cast<std::uint8_t>(missing | (label[u] != 0 ? 2 : 0));
    }
  });
  std::array<std::vector<int>, kRowStrips> found;
  ForEachStrip(rows, [&](std::size_t strip, int first, int last) {
    std::vector<std::uint8_t> is_out(width + sizeof(std::uint64_t));  // zeros behind the row
    const std::vector<std::uint8_t> nothing(width);
    for (int v = first; v < last; ++v) {
      const auto* row = open.ptr<std::uint8_t>(v);
      const auto* above = v > 0 ? open.ptr<std::uint8_t>(v - 1) : nothing.data();
      const auto* below = v + 1 < rows ? open.ptr<std::uint8_t>(v + 1) : nothing.data();
      const auto* up = v > 0 ? links.down.ptr<std::uint8_t>(v - 1) : nothing.data();
      const auto* down = links.down.ptr<std::uint8_t>(v);
      const auto* right = links.right.ptr<std::uint8_t>(v);
      auto* to = is_out.data();
      std::fill(to, to + cols, std::uint8_t{0});
      AddWhereLinked(up, above, cols, to);
      AddWhereLinked(down, below, cols, to);
      AddWhereLinked(right, row + 1, cols - 1, to);
      AddWhereLinked(right, row, cols - 1, to + 1);
      // Bit 0: a neighbour lacks a label; and there is one here.
      for (int u = 0; u < cols; ++u) to[u] = static_cast<std::uint8_t>(to[u] & (row[u] >> 1));
      for (int u = 0; u < cols; u += static_cast<int>(sizeof(std::uint64_t))) {
        std::uint64_t eight = 0;
        std::memcpy(&eight, to + u, sizeof(eight));
        for (int i = u; eight != 0 && i < u + static_cast<int>(sizeof(eight)); ++i) {
          if (to[i] != 0) found[strip].push_back(v * cols + i);
        }
      }
    }
  });
  std::vector<int> all;
  for (const auto& of_strip : found) all.insert(all.end(), of_strip.begin(), of_strip.end());
  return all;
}

}  // namespace

cv::Rect RectangleOf(std::span<const int> pixels, int columns) {
  if (pixels.empty()) return {};
  int left = columns;
  int right = 0;
  for (const int pixel : pixels) {
    left = std::min(left, pixel % columns);
    right = std::max(right, pixel % columns);
  }
  const int top = pixels.front() / columns;
  return {left, top, right - left + 1, pixels.back() / columns - top + 1};
}

std::int32_t LabelComponents(const cv::Mat& member, const PixelLinks& links, std::int32_t first,
                             cv::Mat& labels) {
  const int rows = member.rows;
  std::vector<std::vector<RunOfPixels>> runs(static_cast<std::size_t>(rows));
  ForEachRow(rows, [&](int v) {
    runs[static_cast<std::size_t>(v)] =
        RunsOf(member.ptr<std::uint8_t>(v), links.right.ptr<std::uint8_t>(v), member.cols);
  });
  std::vector<std::int32_t> first_of_row;
  std::int32_t count = 0;
  for (const auto& of_row : runs) {
    first_of_row.push_back(count);
    count += static_cast<std::int32_t>(of_row.size());
  }
  DisjointSets sets(static_cast<std::size_t>(count));
  for (std::size_t v = 0; v + 1 < runs.size(); ++v) {
    JoinRows(runs[v], first_of_row[v], runs[v + 1], first_of_row[v + 1],
             links.down.ptr<std::uint8_t>(static_cast<int>(v)), sets);
  }
  std::vector<std::int32_t> label_of(static_cast<std::size_t>(count));
  std::int32_t next = first;
  for (std::int32_t run = 0; run < count; ++run) {
    const std::int32_t root = sets.Find(run);
    // A set's least run comes first.
    label_of[static_cast<std::size_t>(run)] =
        root == run ? next++ : label_of[static_cast<std::size_t>(root)];
  }
  ForEachRow(rows, [&](int v) {
    auto* to = labels.ptr<std::int32_t>(v);
    auto run = static_cast<std::size_t>(first_of_row[static_cast<std::size_t>(v)]);
    for (const RunOfPixels& pixels : runs[static_cast<std::size_t>(v)]) {
      std::fill(to + pixels.begin, to + pixels.end, label_of[run++]);
    }
  });
  return next;
}

void GrowLabels(const cv::Mat& known, const PixelLinks& links, cv::Mat& scratch, cv::Mat& labels) {
  const int cols = labels.cols;
  const int rows = labels.rows;
  const auto* q = known.ptr<float>();
  const auto* right = links.right.ptr<std::uint8_t>();
  const auto* down = links.down.ptr<std::uint8_t>();
  auto* label = labels.ptr<std::int32_t>();
  // The neighbours that a pixel has links to.
  const auto for_each_neighbour = [&](int at, const auto& with) {
    const int u = at % cols;
    if (at >= cols && down[at - cols] != 0) with(at - cols);
    if (u > 0 && right[at - 1] != 0) with(at - 1);
    if (u + 1 < cols && right[at] != 0) with(at + 1);
    if (at + cols < rows * cols && down[at] != 0) with(at + cols);
  };
  std::vector<int> ring = OutermostOf(known, links, labels, scratch);  // got their labels last
  std::vector<int> next_ring;
  while (!ring.empty()) {
    next_ring.clear();
    for (const int at : ring) {
      for_each_neighbour(at, [&](int next) {
        if (label[next] != 0 || q[next] == 0) return;
        label[next] = label[at];
        next_ring.push_back(next);
      });
    }
    ring.swap(next_ring);
  }
}

std::vector<std::int32_t> CountLabels(const cv::Mat& labels, std::int32_t end) {
  std::vector<std::int32_t> pixels(static_cast<std::size_t>(end));
  ForEachRunOfLabel(labels, cv::Mat(), [&](const RunOfLabel& run) {
    pixels[static_cast<std::size_t>(run.label)] += run.pixels;
  });
  return pixels;
}

std::vector<PartSize> MeasureParts(const cv::Mat& labels, const cv::Mat& depth, float pixel,
                                   std::int32_t end) {
  std::vector<PartSize> sizes(static_cast<std::size_t>(end));
  const double pixel_m2 = double{pixel} * double{pixel};
  ForEachRunOfLabel(labels, depth, [&](const RunOfLabel& run) {
    PartSize& size = sizes[static_cast<std::size_t>(run.label)];
    size.pixels += run.pixels;
    size.area_m2 += pixel_m2 * double{run.squares};
  });
  return sizes;
}

std::int32_t JoinSmall(const PixelLinks& links, const PartSize& least, std::int32_t first,
                       std::vector<PartSize> sizes, cv::Mat& labels) {
  Joining joining(least, std::move(sizes));
  joining.CountLinks(links, labels);
  joining.JoinAll();
  const std::vector<std::int32_t> becomes = joining.NumberParts(first);
  ForEachRow(labels.rows, [&](int v) {
    auto* row = labels.ptr<std::int32_t>(v);
    for (int u = 0; u < labels.cols; ++u) row[u] = becomes[static_cast<std::size_t>(row[u])];
  });
  return first;
}

}  // namespace tsdfpp
