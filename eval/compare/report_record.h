// What a report needs of a comparison besides its figures: the maps at some ten key frames,
// decimated and quantised, the true surfaces, poses, small images, and measures of every frame.
// Written to record/record.json and record/record.bin (docs/report.md).
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/compare/compare.h"
#include "eval/tools/packed_mesh.h"
#include "eval/truth/sight_log.h"

namespace tsdfpp {

// Of `evaluated`, at most `most`, evenly spread, the last one and `examined` (where it is one)
// among them.
std::vector<int> ChooseKeyFrames(const std::vector<int>& evaluated, std::optional<int> examined,
                                 std::size_t most);

// A still's file below record/stills/; `what` is colour, mask or a map's folder.
std::string StillName(const std::string& what, int frame);

class ReportRecorder {
 public:
  // `result` must outlive it and have its runs.
  ReportRecorder(const CompareResult& result, std::filesystem::path out);

  // Each frame in order, once the truth has observed it.
  void SeeFrame(const Frame& true_frame);

  // One map after it has processed a frame, each frame in order.
  void SeeMap(const CompareRun& run);

  // One map's evaluation at the frame that was seen last; `frame` as the maps saw it. Writes the
  // stills of the video. Errors: kEnvironment where the disk refuses.
  Expected<void> Take(const CompareRun& run, const Evaluation& evaluation, const Frame& frame);
  // Drops a map that failed, before it leaves the result's runs.
  void Forget(const CompareRun& run);

  // Removes what was written: frames that ended early have no recording. Errors: kEnvironment where
  // the disk refuses.
  Expected<void> Discard() const;

  // The rest: record.json, record.bin. Errors: kEnvironment where the disk refuses.
  Expected<void> Write();

 private:
  nlohmann::json Add(const std::string& bytes);
  // The image as a file; nothing where it cannot be encoded, which failure_ then says.
  std::string Encoded(const cv::Mat& rgb, bool lossless);
  nlohmann::json AddImage(const cv::Mat& rgb, bool lossless);
  Expected<void> WriteStill(const std::string& name, int frame, const std::string& bytes) const;
  nlohmann::json AddMesh(const TriangleMesh& mesh, const VertexMeasures& measures);
  void AddChunks(const TriangleMesh& mesh, const char* layer, std::size_t triangles,
                 nlohmann::json& chunks);
  void AddKeyFrame(const Frame& frame);
  nlohmann::json TruthJson();
  nlohmann::json ObjectsJson() const;
  // How far the run's poses of what moved are from the true ones, by frame.
  void AddErrors(const CompareRun& run, nlohmann::json& json) const;
  std::size_t IndexOf(const CompareRun& run) const;

  const CompareResult& result_;
  std::filesystem::path out_;
  std::vector<int> key_frames_;
  PositionGrid grid_;
  SightLog sights_;
  std::string bytes_;
  nlohmann::json frames_ = nlohmann::json::array();
  nlohmann::json keys_ = nlohmann::json::array();
  std::vector<int> stills_;
  std::vector<nlohmann::json> runs_;
  std::optional<Error> failure_;
  float nearest_m_ = 0;  // depth that the depth images show, fixed at the first key frame
  float farthest_m_ = 0;
};

}  // namespace tsdfpp
