// One cell of an experiment: a mapper with its settings on the frames of a sequence. Its file is
// named after the hash of all that determines it, so a cell that is there need never run again.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/sweep/sequence_variant.h"
#include "eval/sweep/sweep_metrics.h"

namespace tsdfpp {

inline constexpr int kCellSchema = 2;

struct Cell {
  CellSettings settings;
  // All that its figures depend on, as text: program, renderer, frames, truth, map settings.
  std::string key;
  std::string id;        // HashText(key)
  std::string sequence;  // HashText of the part of the key that is about frames
  // Of the variant: the frames used, those evaluated, and the one examined.
  std::vector<int> frames{};
  std::vector<int> evaluated{};
  int examined = 0;
};

// `program` and `renderer`: what makes the frames and the figures.
Cell MakeCell(const CellSettings& settings, const SequenceVariant& variant,
              const std::string& program, const std::string& renderer);

struct CellFrame {
  int frame = 0;
  bool examined = false;
  std::vector<Measured> values;  // in the order of SweepMetrics(), those of an evaluation only
  std::string map_digest;        // MeshDigest of the visible scene
};

struct CellResult {
  std::vector<CellFrame> frames;             // the evaluated ones
  std::vector<Measured> examined;            // all of SweepMetrics(), at the examined frame
  nlohmann::json evaluation;                 // everything, at the examined frame
  std::vector<InstanceId> removed;           // at the examined frame
  std::map<int, std::string> image_digests;  // ImageDigest of every frame used
  nlohmann::json times;                      // RunTimes::ToJson; null where steps are not measured
  std::vector<double> frame_ms;              // of each frame used
  // The run in which it was timed: cells of one run took turns, frame by frame, so that their times
  // may be compared.
  std::string timed_in;
};

// Of the bytes of depth, mask and colour as the mapper got them, and its poses as text.
std::string ImageDigest(const Frame& frame);
// Of vertices, triangles, colours and face ids.
std::string MeshDigest(const TriangleMesh& mesh);

// A frame's number and an object's id in JSON. They throw std::out_of_range, with words, where it
// is none: nlohmann's own conversion wraps what does not fit.
int FrameFromJson(const nlohmann::json& value);
InstanceId ObjectFromJson(const nlohmann::json& value);

nlohmann::json CellToJson(const Cell& cell, const CellResult& result);
// Errors: kData, in a sentence: not JSON, another schema, a field that is missing or wrong, and
// what no run of this cell can have said: other frames, settings of another map, a figure out of
// its metric's range or other than the examined frame's.
Expected<CellResult> CellFromJson(const std::string& text, const Cell& cell);

// A folder with a file a cell, each whole or not there.
class CellStore {
 public:
  explicit CellStore(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::filesystem::path PathOf(const std::string& id) const { return folder_ / (id + ".json"); }
  // Whether the cell is there, with this key, and can be read.
  bool Has(const Cell& cell) const { return Read(cell).has_value(); }
  Expected<CellResult> Read(const Cell& cell) const;
  // Errors: kEnvironment.
  Expected<void> Write(const Cell& cell, const CellResult& result) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace tsdfpp
