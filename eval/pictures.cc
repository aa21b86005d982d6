#include "eval/pictures.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/files.h"
#include "core/limits.h"
#include "eval/rasteriser.h"
#include "eval/record_images.h"

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
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", bgr, bytes, {cv::IMWRITE_PNG_COMPRESSION, 9})) {
    return EnvironmentError("{}: a picture of {}x{} cannot be encoded", path.string(), bgr.cols,
                            bgr.rows);
  }
  return WriteFile(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
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

}  // namespace

Colour ObjectColour(InstanceId id) {
  constexpr std::array<Colour, 7> kPalette{{{0, 114, 178},
                                            {230, 159, 0},
                                            {0, 158, 115},
                                            {204, 121, 167},
                                            {86, 180, 233},
                                            {213, 94, 0},
                                            {240, 228, 66}}};
  if (id == kBackground) return {205, 203, 198};
  return kPalette[(id - 1U) % kPalette.size()];
}

cv::Mat DrawScene(const TriangleMesh& scene_W, const Intrinsics& intrinsics, const Pose& T_WC,
                  double scale) {
  const Raster raster = Rasterise(scene_W, intrinsics, T_WC);
  cv::Mat image(intrinsics.height, intrinsics.width, CV_8UC3, cv::Scalar(255, 255, 255));
  const Eigen::Vector3f camera_W = T_WC.translation().cast<float>();
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const int face = raster.face.at<int>(v, u);
      if (face < 0) continue;
      const auto& t = scene_W.triangles[static_cast<std::size_t>(face)];
      const Eigen::Vector3f& a = scene_W.vertices[t[0]];
      const Eigen::Vector3f normal =
          (scene_W.vertices[t[1]] - a).cross(scene_W.vertices[t[2]] - a).stableNormalized();
      // Lit from the camera and from above; what faces away from the camera is darkened.
      const float facing = normal.dot((camera_W - a).normalized());
      const float light =
          facing > 0 ? 0.35F + 0.45F * facing + 0.2F * std::max(0.0F, normal.z()) : 0.2F;
      const Colour base = scene_W.face_ids.empty()
                              ? ObjectColour(kBackground)
                              : ObjectColour(scene_W.face_ids[static_cast<std::size_t>(face)]);
      auto& pixel = image.at<cv::Vec3b>(v, u);
      for (int c = 0; c < 3; ++c) {
        pixel[c] = static_cast<std::uint8_t>(static_cast<float>(base[static_cast<std::size_t>(c)]) *
                                             std::min(1.0F, light));
      }
    }
  }
  return Scaled(image, 1 / scale, cv::INTER_AREA);
}

cv::Mat DrawTable(const SceneTruth& truth, const Selection& reconstructed, double pixel_m) {
  const SeenTracker& tracker = truth.trackers().front();
  const SampleSet& samples = tracker.samples_O();
  const std::vector<std::string>& regions = truth.surface(0).model().regions;
  // The top alone: what faces up and is as high as the highest.
  float top = -1e9F;
  const auto on_table = [&](std::size_t i) {
    return regions[samples.region[i]] == kTableRegion && samples.normals[i].z() > 0.9F;
  };
  Eigen::AlignedBox2f bounds;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (on_table(i)) top = std::max(top, samples.points[i].z());
  }
  const auto on_top = [&](std::size_t i) {
    return on_table(i) && samples.points[i].z() > top - 0.01F;
  };
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (on_top(i)) bounds.extend(samples.points[i].head<2>());
  }
  if (bounds.isEmpty()) return {};
  const auto pixel = static_cast<float>(pixel_m);
  const Eigen::Vector2f sides = (bounds.sizes() / pixel).array().ceil();
  const auto most = static_cast<float>(CurrentLimits().image_side - 1);
  if (!(sides.maxCoeff() < most)) return {};  // no table that is looked at from above
  const int width = static_cast<int>(sides.x()) + 1;
  const int height = static_cast<int>(sides.y()) + 1;
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(150, 150, 150));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!on_top(i)) continue;
    cv::Scalar colour(150, 150, 150);
    if (tracker.Seen(i)) {
      const bool there = i < reconstructed.size() && reconstructed[i] != 0;
      switch (tracker.status()[i]) {
        case SampleStatus::kVisible:
        case SampleStatus::kUnmeasured:
          colour = there ? cv::Scalar(238, 234, 224) : cv::Scalar(245, 170, 60);
          break;
        case SampleStatus::kBehindOther:
          colour = there ? cv::Scalar(86, 150, 210) : cv::Scalar(215, 25, 28);
          break;
        case SampleStatus::kBehindItself:
        case SampleStatus::kOutside:
          colour = there ? cv::Scalar(200, 215, 225) : cv::Scalar(170, 60, 60);
          break;
      }
    }
    const Eigen::Vector2f at = (samples.points[i].head<2>() - bounds.min()) / pixel;
    // Samples are jittered in their cells: squares a little larger than a cell leave no gaps.
    const float half = 0.8F * std::sqrt(samples.area_m2[i]) / pixel;
    // y of the world points up in the picture.
    cv::rectangle(image, cv::Point2f(at.x() - half, static_cast<float>(height) - at.y() - half),
                  cv::Point2f(at.x() + half, static_cast<float>(height) - at.y() + half), colour,
                  cv::FILLED);
  }
  return image;
}

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
  const Measured& hole = evaluation.objects.front().preserved.hole_area_cm2;
  const std::string text =
      hole.value ? fmt::format("hole {:.0f} of {:.0f} cm2 hidden", *hole.value,
                               evaluation.objects.front().preserved.behind_other_area_cm2)
                 : "nothing hidden";
  if (table.empty())
    table = cv::Mat(1, static_cast<int>(kCellWidth), CV_8UC3, cv::Scalar(255, 255, 255));
  cv::copyMakeBorder(table, table, 0, 26, 0, 0, cv::BORDER_CONSTANT, cv::Scalar(255, 255, 255));
  Write(table, text, {4, table.rows - 8}, 0.5);
  tables_[run] = table;
  return {};
}

Expected<void> PictureMaker::Finish() {
  if (cells_.empty()) return {};  // every adapter failed, and there was nothing else
  for (const PoseSource poses : result_.config.poses) {
    std::vector<std::string> table_rows;
    std::vector<std::vector<cv::Mat>> table_cells;
    std::vector<std::string> table_columns;
    for (const Method method : result_.config.methods)
      table_columns.emplace_back(MethodName(method));
    for (const auto& run : result_.adapters) {
      if (!run->failure) table_columns.push_back(run->config.name);
    }
    for (const std::string& profile : result_.config.profiles) {
      std::vector<std::string> titles;
      std::vector<cv::Mat> camera_row;
      for (const int frame : Columns()) {
        titles.push_back(fmt::format("frame {}", frame));
        camera_row.push_back(camera_.at(frame));
      }
      titles.emplace_back("after the removal");
      std::vector<std::string> rows{"camera"};
      std::vector<std::vector<cv::Mat>> cells{camera_row};
      table_rows.push_back("profile " + profile);
      table_cells.emplace_back();
      const auto add = [&](const void* run, const std::string& title) {
        std::vector<cv::Mat> row;
        for (const int frame : Columns()) row.push_back(cells_.at(run).at(frame));
        row.push_back(after_removal_.at(run));
        rows.push_back(title);
        cells.push_back(row);
        table_cells.back().push_back(tables_.at(run));
      };
      for (const Method method : result_.config.methods) {
        const auto run = std::find_if(
            result_.runs.begin(), result_.runs.end(), [&](const std::unique_ptr<CompareRun>& each) {
              return each->config.method == method && each->profile == profile &&
                     each->config.poses == poses;
            });
        if (run != result_.runs.end()) {
          add(run->get(), std::string(MethodName(method)));
        } else {  // it failed
          table_cells.back().emplace_back();
        }
      }
      // An adapter has no profile; it stands beside each.
      for (const auto& run : result_.adapters) {
        if (!run->failure) add(run.get(), run->config.name);
      }
      const std::string file = fmt::format("figure-{}-{}.png", profile, PoseSourceName(poses));
      TSDFPP_RETURN_IF_ERROR(SavePng(out_ / file, Grid(titles, rows, cells)));
      files_.push_back(
          {file, fmt::format("Reconstructions over time and after the removal, profile {}, {}",
                             profile, poses == PoseSource::kGiven ? "given object poses" : "ICP")});
    }
    const std::string file = fmt::format("table-{}.png", PoseSourceName(poses));
    TSDFPP_RETURN_IF_ERROR(SavePng(out_ / file, Grid(table_columns, table_rows, table_cells)));
    files_.push_back({file,
                      "The table from above after the removal: hidden and kept (blue), hidden and "
                      "missing (red), visible (light), visible and missing (orange), never seen "
                      "(grey)"});
  }
  return {};
}

}  // namespace tsdfpp
