#include "bench/side_by_side_cases.h"

#include <fmt/ranges.h>

#include <algorithm>

namespace tsdfpp {

const std::vector<SideBySideCase>& SideBySideCases() {
  static const std::vector<SideBySideCase> cases{
      {"1cm", "1 cm, band of 10 voxels", 0.01, 10, false},
      {"5mm", "5 mm, band of 6 voxels", 0.005, 6, false},
      {"2mm", "2 mm, band of 6 voxels, one object alone", 0.002, 6, true}};
  return cases;
}

Expected<std::vector<SideBySideCase>> CasesNamed(const std::vector<std::string>& names) {
  std::vector<SideBySideCase> cases;
  for (const std::string& name : names) {
    const auto& all = SideBySideCases();
    const auto found = std::find_if(all.begin(), all.end(),
                                    [&](const SideBySideCase& c) { return c.name == name; });
    if (found == all.end()) {
      std::vector<std::string> known;
      for (const SideBySideCase& c : all) known.push_back(c.name);
      return UsageError("case '{}' is unknown, expected one of {}", name, fmt::join(known, ", "));
    }
    cases.push_back(*found);
  }
  return cases;
}

Expected<std::vector<Frame>> ReadFramesInARow(FrameSource& source, const SideBySideCase& of,
                                              int first, int last) {
  std::vector<Frame> frames;
  for (int i = first; i < std::min(first + kFramesInARow, last); ++i) {
    TSDFPP_ASSIGN(Frame frame, source.Read(source.info().first_index + i));
    if (of.one_object) {
      const InstanceId object = source.info().objects.at(1).id;
      frame.depth.setTo(0, frame.mask != object);
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace tsdfpp
