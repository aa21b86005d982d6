#include "eval/compare/pictures.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/encode_image.h"
#include "core/files.h"
#include "eval/picture/draw_scene.h"
#include "eval/picture/record_images.h"
#include "eval/score/evaluation_columns.h"

namespace tsdfpp {
namespace {

constexpr double kCellWidth = 384;  // pixels; images are scaled to it
constexpr double kTablePixel_m = 0.0025;
constexpr std::size_t kMaxColumns = 4;

void Write(cv::Mat& image, const std::string& text, cv::Point at, double size = 0.5,
           int thickness = 1) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, cv::Scalar(30, 30, 30), thickness,
              cv::LINE_AA);
}

Expected<void> SavePng(const std::filesystem::path& path, const cv::Mat& rgb) {
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  TSDFPP_ASSIGN(const std::string bytes,
                EncodeImage(bgr, ".png", path.string(), {cv::IMWRITE_PNG_COMPRESSION, 6}));
  return WriteFile(path, bytes);
}

// Rows of cells of equal size below a line of column titles, each row under its own title.
cv::Mat Grid(const std::vector<std::string>& columns, const std::vector<std::string>& rows,
             const std::vector<std::vector<cv::Mat>>& cells) {
  constexpr int kGap = 6;
  constexpr int kTitle = 26;
  cv::Size cell(1, 1);
  for (const auto& row : cells) {
    for (const cv::Mat& image : row) {
      cell.width = std::max(cell.width, image.cols);
      cell.height = std::max(cell.height, image.rows);
    }
  }
  const auto n_columns = static_cast<int>(columns.size());
  const auto n_rows = static_cast<int>(rows.size());
  cv::Mat grid(kTitle + n_rows * (kTitle + cell.height + kGap),
               n_columns * (cell.width + kGap) + kGap, CV_8UC3, cv::Scalar(255, 255, 255));
  for (int c = 0; c < n_columns; ++c) {
    Write(grid, columns[static_cast<std::size_t>(c)], {kGap + c * (cell.width + kGap), 18}, 0.5);
  }
  for (int r = 0; r < n_rows; ++r) {
    const int top = kTitle + r * (kTitle + cell.height + kGap);
    Write(grid, rows[static_cast<std::size_t>(r)], {kGap, top + 19}, 0.55, 1);
    const auto& row = cells[static_cast<std::size_t>(r)];
    for (int c = 0; c < static_cast<int>(row.size()); ++c) {
      const cv::Mat& image = row[static_cast<std::size_t>(c)];
      if (image.empty()) continue;
      image.copyTo(grid({kGap + c * (cell.width + kGap), top + kTitle, image.cols, image.rows}));
    }
  }
  return grid;
}

// The methods, and the adapters that did not fail.
std::vector<std::string> TitlesOf(const CompareResult& result) {
  std::vector<std::string> titles;
  for (const Method method : result.config.methods) titles.emplace_back(MethodName(method));
  for (const auto& run : result.adapters) {
    if (!run->failure) titles.push_back(run->config.name);
  }
  return titles;
}

}  // namespace

PictureMaker::PictureMaker(const CompareResult& result, std::filesystem::path out)
    : result_(result), out_(std::move(out)) {}

int PictureMaker::ExaminedFrame() const {
  return result_.reveal_frame.value_or(result_.last_frame);
}

std::vector<int> PictureMaker::Columns() const {
  std::vector<int> evaluated;
  const int first = result_.info.first_index;
  for (int index = first; index <= ExaminedFrame(); ++index) {
    if ((index - first + 1) % result_.config.every == 0 || index == ExaminedFrame()) {
      evaluated.push_back(index);
    }
  }
  std::vector<int> columns;
  const std::size_t count = std::min(kMaxColumns, evaluated.size());
  for (std::size_t i = 0; i < count; ++i) {
    columns.push_back(evaluated[(i + 1) * evaluated.size() / count - 1]);
  }
  return columns;
}

Expected<void> PictureMaker::Take(const void* run, const Evaluation& evaluation,
                                  const Frame& frame) {
  const double scale = frame.intrinsics.width / kCellWidth;
  const std::vector<int> columns = Columns();
  if (std::find(columns.begin(), columns.end(), frame.index) != columns.end()) {
    cells_[run][frame.index] = DrawScene(evaluation.scene, frame.intrinsics, frame.T_WC, scale);
    camera_[frame.index] = Scaled(frame.colour, 1 / scale, cv::INTER_AREA);
  }
  if (frame.index != ExaminedFrame()) return {};
  after_removal_[run] = DrawScene(evaluation.revealed, frame.intrinsics, frame.T_WC, scale);
  cv::Mat table = DrawTable(*result_.truth, evaluation.table_reconstructed, kTablePixel_m);
  const PreservationScores& preserved = TableOf(evaluation).preserved;
  const Measured& hole = preserved.hole_area_cm2;
  const std::string text = hole.value ? fmt::format("hole {:.0f} of {:.0f} cm2 hidden", *hole.value,
                                                    preserved.behind_other_area_cm2)
                           : KnowsBackground(evaluation) ? "nothing hidden"
                                                         : kNoTrueBackground;
  if (table.empty())
    table = cv::Mat(1, static_cast<int>(kCellWidth), CV_8UC3, cv::Scalar(255, 255, 255));
  cv::copyMakeBorder(table, table, 0, 26, 0, 0, cv::BORDER_CONSTANT, cv::Scalar(255, 255, 255));
  Write(table, text, {4, table.rows - 8}, 0.5);
  tables_[run] = table;
  return {};
}

std::vector<PictureMaker::Row> PictureMaker::RowsOf(const std::string& profile,
                                                    PoseSource poses) const {
  std::vector<Row> rows;
  for (const Method method : result_.config.methods) {
    const auto run = std::find_if(result_.runs.begin(), result_.runs.end(),
                                  [&](const std::unique_ptr<CompareRun>& each) {
                                    return each->config.method == method &&
                                           each->profile == profile && each->config.poses == poses;
                                  });
    rows.push_back({std::string(MethodName(method)),
                    run == result_.runs.end() ? nullptr : static_cast<const void*>(run->get())});
  }
  // An adapter has no profile; it stands beside each.
  for (const auto& run : result_.adapters) {
    if (!run->failure) rows.push_back({run->config.name, run.get()});
  }
  return rows;
}

cv::Mat PictureMaker::Figure(const std::vector<Row>& runs) const {
  std::vector<std::string> titles;
  std::vector<cv::Mat> camera_row;
  for (const int frame : Columns()) {
    titles.push_back(fmt::format("frame {}", frame));
    camera_row.push_back(camera_.at(frame));
  }
  titles.emplace_back("after the removal");
  std::vector<std::string> rows{"camera"};
  std::vector<std::vector<cv::Mat>> cells{camera_row};
  for (const auto& [title, run] : runs) {
    if (run == nullptr) continue;
    std::vector<cv::Mat> row;
    for (const int frame : Columns()) row.push_back(cells_.at(run).at(frame));
    row.push_back(after_removal_.at(run));
    rows.push_back(title);
    cells.push_back(row);
  }
  return Grid(titles, rows, cells);
}

Expected<void> PictureMaker::Finish() {
  if (cells_.empty()) return {};  // every adapter failed, and there was nothing else
  for (const PoseSource poses : result_.config.poses) {
    std::vector<std::string> table_rows;
    std::vector<std::vector<cv::Mat>> table_cells;
    for (const std::string& profile : result_.config.profiles) {
      const std::vector<Row> rows = RowsOf(profile, poses);
      table_rows.push_back("profile " + profile);
      table_cells.emplace_back();
      for (const Row& row : rows) {
        table_cells.back().push_back(row.run == nullptr ? cv::Mat() : tables_.at(row.run));
      }
      const std::string file = fmt::format("figure-{}-{}.png", profile, PoseSourceName(poses));
      TSDFPP_RETURN_IF_ERROR(SavePng(out_ / file, Figure(rows)));
      files_.push_back(
          {file, fmt::format(
                     "Reconstructions over time and after the removal, profile {}, {}", profile,
                     poses == PoseSource::kGiven ? "given object poses" : PoseSourceTitle(poses))});
    }
    const std::string file = fmt::format("table-{}.png", PoseSourceName(poses));
    TSDFPP_RETURN_IF_ERROR(SavePng(out_ / file, Grid(TitlesOf(result_), table_rows, table_cells)));
    files_.push_back({file,
                      "The table from above after the removal: hidden and kept (blue), hidden and "
                      "missing (red), visible (light), visible and missing (orange), never seen "
                      "(grey)"});
  }
  return {};
}

}  // namespace tsdfpp
