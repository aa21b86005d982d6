#include "eval/picture/map_views.h"

#include "core/encode_image.h"
#include "core/files.h"
#include "sequence/image_files.h"

namespace tsdfpp {
namespace {

Expected<void> WritePng(const cv::Mat& image, const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const std::string bytes, EncodeImage(image, ".png", path.string()));
  return WriteFile(path, bytes);
}

cv::Mat NormalPicture(const RaySurface& surface) {
  cv::Mat picture(surface.normal.size(), CV_8UC3, cv::Scalar::all(0));
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      if (surface.depth.at<float>(v, u) == 0) continue;
      const auto& normal = surface.normal.at<cv::Vec3f>(v, u);
      for (int c = 0; c < 3; ++c) {
        picture.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<std::uint8_t>(127.5F * (1 + normal[c]));
      }
    }
  }
  return picture;
}

std::string NameOf(const char* what, int number, const char* ending) {
  return fmt::format("{}-{}.{}", what, number, ending);
}

}  // namespace

std::vector<std::string> ViewFiles(int surfaces) {
  std::vector<std::string> files;
  for (int k = 1; k <= surfaces; ++k) {
    for (const char* what : {"colour", "normal", "id"}) files.push_back(NameOf(what, k, "png"));
    files.push_back(NameOf("depth", k, "exr"));
  }
  return files;
}

Expected<void> WriteViews(const MapRepresentation& map, const Intrinsics& camera, const Pose& T_WC,
                          int surfaces, const std::filesystem::path& folder) {
  RayCastOptions options;
  options.surfaces = surfaces;
  int number = 0;
  for (const RaySurface& surface : map.CastRays(camera, T_WC, options)) {
    ++number;
    const auto path = [&](const char* what, const char* ending) {
      return folder / NameOf(what, number, ending);
    };
    TSDFPP_ASSIGN(const std::string colour, EncodeColour(surface.colour, path("colour", "png")));
    TSDFPP_RETURN_IF_ERROR(WriteFile(path("colour", "png"), colour));
    TSDFPP_ASSIGN(const std::string depth, EncodeDepth(surface.depth, path("depth", "exr")));
    TSDFPP_RETURN_IF_ERROR(WriteFile(path("depth", "exr"), depth));
    const cv::Mat normal = NormalPicture(surface);
    TSDFPP_ASSIGN(const std::string encoded, EncodeColour(normal, path("normal", "png")));
    TSDFPP_RETURN_IF_ERROR(WriteFile(path("normal", "png"), encoded));
    TSDFPP_RETURN_IF_ERROR(WritePng(surface.id, path("id", "png")));
  }
  return {};
}

}  // namespace tsdfpp
