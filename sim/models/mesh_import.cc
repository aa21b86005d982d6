#include "sim/models/mesh_import.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/decode_image.h"
#include "core/files.h"
#include "core/ply.h"
#include "sim/models/mesh_repair.h"

namespace tsdfpp {
namespace {

constexpr Colour kUnpainted{200, 198, 192};
constexpr int kMostPictureSide_px = 2048;
constexpr std::size_t kMostPictures = 16;
// Side of a triangle's cell in a picture made of the vertices' colours.
constexpr int kCell_px = 4;

Expected<RawMesh> ReadPlyMesh(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(TriangleMesh ply, ReadPly(path));
  if (ply.triangles.size() > kMaxImportedTriangles) {
    return DataError("{}: has {} triangles, expected {} at most: simplify it", path.string(),
                     ply.triangles.size(), kMaxImportedTriangles);
  }
  RawMesh mesh;
  for (const Eigen::Vector3f& vertex : ply.vertices) {
    mesh.vertices.emplace_back(vertex.cast<double>());
  }
  mesh.colours = std::move(ply.colours);
  for (const auto& vertices : ply.triangles) {
    RawTriangle triangle;
    triangle.vertex = vertices;
    mesh.triangles.push_back(triangle);
  }
  return mesh;
}

Expected<RawMesh> ReadRaw(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending != ".obj" && ending != ".stl" && ending != ".ply") {
    return UsageError("{}: a mesh is expected to be an .obj, .stl or .ply file", path.string());
  }
  if (ending == ".ply") return ReadPlyMesh(path);
  TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
  return ending == ".obj" ? ReadObj(path, bytes) : ReadStl(path, bytes);
}

Expected<void> CheckSize(const std::string& file, const RawMesh& mesh, double scale) {
  Eigen::AlignedBox3d box;
  for (const RawTriangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle.vertex) box.extend(mesh.vertices[vertex]);
  }
  const Eigen::Vector3d size = box.sizes();
  const double longest = size.maxCoeff();
  if (longest >= kLeastExtent_m && longest <= kMostExtent_m) return {};
  return UsageError(
      "{}: is {:.4g} x {:.4g} x {:.4g} m at scale {:.4g}, expected a longest side of {} to {} m: "
      "is the "
      "file in another unit? Set scale (0.001 for millimetres)",
      file, size.x(), size.y(), size.z(), scale, kLeastExtent_m, kMostExtent_m);
}

Expected<std::shared_ptr<const TextureImage>> LoadPicture(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(cv::Mat image, ReadImageFile(path, DecodeAs::kColour));
  const double shrink = static_cast<double>(kMostPictureSide_px) / std::max(image.rows, image.cols);
  if (std::min(image.rows, image.cols) * shrink < 1) {
    return DataError("{}: the picture is {}x{}, too long for its width", path.string(), image.cols,
                     image.rows);
  }
  if (shrink < 1) cv::resize(image, image, {}, shrink, shrink, cv::INTER_AREA);
  cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  auto picture = std::make_shared<TextureImage>();
  picture->material = "picture:" + path.string();
  picture->width = image.cols;
  picture->height = image.rows;
  picture->pixels.assign(image.datastart, image.dataend);
  const cv::Scalar mean = cv::mean(image);
  for (int k = 0; k < 3; ++k) picture->mean[k] = static_cast<std::uint8_t>(mean[k]);
  return picture;
}

// The faces that share a picture, or have none.
struct Group {
  std::shared_ptr<const TextureImage> picture;
  std::vector<std::uint32_t> faces;  // of the repaired mesh
};

class Importer {
 public:
  Importer(const std::filesystem::path& path, RawMesh raw)
      : path_(path), file_(path.string()), raw_(std::move(raw)) {}

  Expected<ImportedMesh> Run(double scale, const std::filesystem::path& picture);

 private:
  Expected<std::vector<Group>> GroupFaces(const std::filesystem::path& picture);
  Expected<std::shared_ptr<const TextureImage>> PictureOf(int material);
  bool HasTexcoords(const RawTriangle& triangle) const;
  ModelPart MakePart(const Group& group, const std::string& name) const;
  void PaintByPicture(const Group& group, ModelPart& part) const;
  void PaintByColours(const Group& group, ModelPart& part) const;
  std::array<Colour, 3> CornerColours(std::uint32_t face) const;
  std::array<std::uint32_t, 3> RawCorners(std::uint32_t face) const;
  void WriteReport();

  std::filesystem::path path_;
  std::string file_;
  RawMesh raw_;
  RepairedMesh repaired_;
  MeshReport report_;
  std::map<std::filesystem::path, std::shared_ptr<const TextureImage>> pictures_;
};

bool Importer::HasTexcoords(const RawTriangle& triangle) const {
  return std::none_of(triangle.texcoord.begin(), triangle.texcoord.end(),
                      [](std::uint32_t t) { return t == kNoTexcoord; });
}

// The raw triangle's corners (0, 1, 2) in the order in which the repaired one has them.
std::array<std::uint32_t, 3> Importer::RawCorners(std::uint32_t face) const {
  if (repaired_.is_turned[face]) return {0, 2, 1};
  return {0, 1, 2};
}

// A picture that cannot be had costs a remark, not the mesh.
Expected<std::shared_ptr<const TextureImage>> Importer::PictureOf(int material) {
  if (material == kNoMaterial) return nullptr;
  const std::filesystem::path& path = raw_.materials[static_cast<std::size_t>(material)].picture;
  if (path.empty()) return nullptr;
  const auto [entry, is_new] = pictures_.try_emplace(path, nullptr);
  if (!is_new) return entry->second;
  if (pictures_.size() > kMostPictures) {
    return DataError("{}: its materials have more than {} pictures, expected at most that", file_,
                     kMostPictures);
  }
  auto picture = LoadPicture(path);
  if (picture) {
    entry->second = *picture;
  } else {
    report_.remarks.push_back(fmt::format(
        "{}: drawn without the picture of material '{}': {}", file_,
        raw_.materials[static_cast<std::size_t>(material)].name, picture.error().message));
  }
  return entry->second;
}

Expected<std::vector<Group>> Importer::GroupFaces(const std::filesystem::path& picture) {
  std::vector<Group> groups(1);  // the first has no picture
  std::map<const TextureImage*, std::size_t> index{{nullptr, 0}};
  std::shared_ptr<const TextureImage> given;
  if (!picture.empty()) {
    TSDFPP_ASSIGN(given, LoadPicture(picture));
  }
  std::size_t without = 0;  // faces of a picture that have no texture coordinates
  for (std::uint32_t face = 0; face < repaired_.source.size(); ++face) {
    const RawTriangle& triangle = raw_.triangles[repaired_.source[face]];
    std::shared_ptr<const TextureImage> own = given;
    if (!given) {
      TSDFPP_ASSIGN(own, PictureOf(triangle.material));
    }
    if (own && !HasTexcoords(triangle)) {
      ++without;
      own = nullptr;
    }
    const auto [entry, is_new] = index.try_emplace(own.get(), groups.size());
    if (is_new) groups.push_back({own, {}});
    groups[entry->second].faces.push_back(face);
  }
  if (given && without > 0) {
    return DataError("{}: {} of its faces have no texture coordinates, which the picture {} needs",
                     file_, without, picture.string());
  }
  if (without > 0) {
    report_.remarks.push_back(
        fmt::format("{}: {} faces have a picture but no texture coordinates: drawn without it",
                    file_, without));
  }
  std::erase_if(groups, [](const Group& group) { return group.faces.empty(); });
  return groups;
}

void Importer::PaintByPicture(const Group& group, ModelPart& part) const {
  part.picture = group.picture;
  part.material = group.picture->material;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double areas = 0;
  for (const std::uint32_t face : group.faces) {
    const RawTriangle& raw = raw_.triangles[repaired_.source[face]];
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const std::uint32_t corner : RawCorners(face)) {
      const Eigen::Vector2d& uv = raw_.texcoords[raw.texcoord[corner]];
      // The picture's first row is its top, where v is 1.
      part.corner_uv.emplace_back(static_cast<float>(uv.x()), static_cast<float>(1 - uv.y()));
      middle += uv / 3;
    }
    const auto& [a, b, c] = repaired_.shape.triangles[face];
    const auto& p = repaired_.shape.vertices;
    const double area = (p[b] - p[a]).cross(p[c] - p[a]).norm();
    const auto pixel = [](double share, int count) {
      const double inside = share - std::floor(share);
      return std::min(static_cast<int>(inside * count), count - 1);
    };
    const int column = pixel(middle.x(), group.picture->width);
    const int row = pixel(1 - middle.y(), group.picture->height);
    const std::uint8_t* rgb =
        &group.picture->pixels[3 * static_cast<std::size_t>(row * group.picture->width + column)];
    sum += area * Eigen::Vector3d(rgb[0], rgb[1], rgb[2]);
    areas += area;
  }
  for (int k = 0; k < 3; ++k) {
    part.colour[static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(sum[k] / areas + 0.5);
  }
}

std::array<Colour, 3> Importer::CornerColours(std::uint32_t face) const {
  const RawTriangle& raw = raw_.triangles[repaired_.source[face]];
  std::array<Colour, 3> colours{kUnpainted, kUnpainted, kUnpainted};
  if (!raw_.colours.empty()) {
    const auto corners = RawCorners(face);
    for (std::size_t k = 0; k < 3; ++k) colours[k] = raw_.colours[raw.vertex[corners[k]]];
  } else if (raw.material != kNoMaterial) {
    colours.fill(
        raw_.materials[static_cast<std::size_t>(raw.material)].colour.value_or(kUnpainted));
  }
  return colours;
}

// One colour becomes plain paint. Several become a picture with a cell for each triangle, in whose
// lower left half its colours run from corner to corner.
void Importer::PaintByColours(const Group& group, ModelPart& part) const {
  part.colour = CornerColours(group.faces.front())[0];
  const bool is_plain =
      std::all_of(group.faces.begin(), group.faces.end(), [&](std::uint32_t face) {
        const auto colours = CornerColours(face);
        return std::all_of(colours.begin(), colours.end(),
                           [&](const Colour& c) { return c == part.colour; });
      });
  if (is_plain) return;
  const auto cells =
      static_cast<int>(std::ceil(std::sqrt(static_cast<double>(group.faces.size()))));
  const int side = cells * kCell_px;
  auto picture = std::make_shared<TextureImage>();
  picture->material = fmt::format("colours:{}:{}", file_, part.name);
  picture->width = picture->height = side;
  picture->pixels.resize(3 * static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < group.faces.size(); ++i) {
    const auto colours = CornerColours(group.faces[i]);
    const int x0 = static_cast<int>(i) % cells * kCell_px;
    const int y0 = static_cast<int>(i) / cells * kCell_px;
    // Corners lie in the middle of pixels, so that interpolation reaches no other cell.
    constexpr int kSpan_px = kCell_px - 2;
    for (const auto& [x, y] : {std::pair{0, 0}, std::pair{kSpan_px, 0}, std::pair{0, kSpan_px}}) {
      part.corner_uv.emplace_back((static_cast<float>(x0 + x) + 0.5F) / static_cast<float>(side),
                                  (static_cast<float>(y0 + y) + 0.5F) / static_cast<float>(side));
    }
    for (int y = 0; y < kCell_px; ++y) {
      for (int x = 0; x < kCell_px; ++x) {
        const double s = static_cast<double>(x) / kSpan_px;
        const double t = static_cast<double>(y) / kSpan_px;
        const auto at = 3 * static_cast<std::size_t>((y0 + y) * side + x0 + x);
        for (std::size_t k = 0; k < 3; ++k) {
          const double value = colours[0][k] + s * (colours[1][k] - colours[0][k]) +
                               t * (colours[2][k] - colours[0][k]);
          picture->pixels[at + k] = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0) + 0.5);
        }
      }
    }
    for (const Colour& colour : colours) {
      sum += Eigen::Vector3d(colour[0], colour[1], colour[2]);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    part.colour[k] = static_cast<std::uint8_t>(
        sum[static_cast<Eigen::Index>(k)] / (3.0 * static_cast<double>(group.faces.size())) + 0.5);
  }
  picture->mean = part.colour;
  part.material = picture->material;
  part.picture = std::move(picture);
}

ModelPart Importer::MakePart(const Group& group, const std::string& name) const {
  ModelPart part;
  part.name = name;
  std::map<std::uint32_t, std::uint32_t> index;  // from the whole mesh's vertices to the part's
  for (const std::uint32_t face : group.faces) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = repaired_.shape.triangles[face][k];
      const auto [entry, is_new] = index.try_emplace(v, static_cast<std::uint32_t>(index.size()));
      if (is_new) part.shape.vertices.push_back(repaired_.shape.vertices[v]);
      triangle[k] = entry->second;
    }
    part.shape.triangles.push_back(triangle);
  }
  if (group.picture) {
    PaintByPicture(group, part);
  } else {
    PaintByColours(group, part);
  }
  if (report_.watertight) return part;
  const std::size_t count = part.shape.triangles.size();
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [a, b, c] = part.shape.triangles[i];
    part.shape.triangles.push_back({a, c, b});
    if (part.corner_uv.empty()) continue;
    for (const std::size_t corner : {0U, 2U, 1U}) {
      part.corner_uv.push_back(part.corner_uv[3 * i + corner]);
    }
  }
  return part;
}

void Importer::WriteReport() {
  report_.remarks = raw_.remarks;
  report_.triangles = repaired_.source.size();
  report_.degenerate = repaired_.degenerate;
  report_.duplicate = repaired_.duplicate;
  report_.turned = repaired_.turned;
  report_.open_edges = repaired_.open_edges;
  report_.watertight = repaired_.open_edges == 0;
  const auto remark = [&](std::size_t count, const char* sentence) {
    if (count > 0) {
      report_.remarks.push_back(
          fmt::format("{}: {} of {} triangles {}", file_, count, raw_.triangles.size(), sentence));
    }
  };
  remark(repaired_.degenerate, "have no area: left out");
  remark(repaired_.duplicate, "are there twice: left out");
  remark(repaired_.turned, "faced the other way than their neighbours, or inwards: turned over");
  if (!report_.watertight) {
    report_.remarks.push_back(fmt::format(
        "{}: is not watertight: {} edges are not shared by exactly two triangles; it is "
        "drawn from both sides",
        file_, repaired_.open_edges));
  }
}

Expected<ImportedMesh> Importer::Run(double scale, const std::filesystem::path& picture) {
  for (Eigen::Vector3d& vertex : raw_.vertices) vertex *= scale;
  if (raw_.triangles.empty()) {
    return DataError("{}: is empty: {} vertices and no face", file_, raw_.vertices.size());
  }
  TSDFPP_RETURN_IF_ERROR(CheckSize(file_, raw_, scale));
  repaired_ = Repair(raw_.vertices, raw_.triangles);
  if (repaired_.source.empty()) {
    return DataError("{}: none of its {} triangles has an area", file_, raw_.triangles.size());
  }
  WriteReport();
  TSDFPP_ASSIGN(const std::vector<Group> groups, GroupFaces(picture));
  ImportedMesh mesh;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    mesh.parts.push_back(MakePart(groups[i], i == 0 ? "mesh" : fmt::format("mesh_{}", i)));
  }
  mesh.report = std::move(report_);
  return mesh;
}

}  // namespace

Expected<ImportedMesh> ImportMesh(const std::filesystem::path& path, double scale,
                                  const std::filesystem::path& picture) {
  TSDFPP_ASSIGN(RawMesh raw, ReadRaw(path));
  return Importer(path, std::move(raw)).Run(scale, picture);
}

}  // namespace tsdfpp
