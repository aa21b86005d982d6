// The pictures of a comparison: the paper's figure made of our meshes, and the table seen from
// above.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "eval/compare/compare.h"

namespace tsdfpp {

struct PictureFile {
  std::string file;  // name in the output folder
  std::string caption;
};

class PictureMaker {
 public:
  // `result` must outlive it and have its runs.
  PictureMaker(const CompareResult& result, std::filesystem::path out);

  // Takes what the pictures need of one evaluation; `run` is a CompareRun or an AdapterRun of the
  // result. Errors: kEnvironment where a picture cannot be
  // written.
  Expected<void> Take(const void* run, const Evaluation& evaluation, const Frame& frame);
  // Writes figure-<profile>-<poses>.png (a row a method; columns frames and after the removal) and
  // table-<profile>-<poses>.png (the table from above after the removal, holes in red).
  Expected<void> Finish();

  const std::vector<PictureFile>& files() const { return files_; }

 private:
  struct Row {
    std::string title;
    const void* run = nullptr;  // none where it failed
  };

  // The runs of the methods with these settings, and the adapters that did not fail.
  std::vector<Row> RowsOf(const std::string& profile, PoseSource poses) const;
  // Rows of the camera and of each run; columns of frames and after the removal.
  cv::Mat Figure(const std::vector<Row>& runs) const;
  // The frames shown as columns: at most four, evenly spread, the last one the examined frame.
  std::vector<int> Columns() const;
  int ExaminedFrame() const;

  const CompareResult& result_;
  std::filesystem::path out_;
  std::vector<PictureFile> files_;
  std::map<const void*, std::map<int, cv::Mat>> cells_;  // by frame
  std::map<const void*, cv::Mat> after_removal_;
  std::map<const void*, cv::Mat> tables_;
  std::map<int, cv::Mat> camera_;  // colour images of the columns
};

}  // namespace tsdfpp
