#include "sim/textures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "core/random.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kSeed = 7;

// Smooth noise in [0, 1): random numbers on a lattice of `cells_x` by `cells_y` that wraps around,
// joined by smoothsteps. u and v in [0, 1).
double Noise(std::uint32_t stream, double u, double v, int cells_x, int cells_y) {
  const auto at = [&](int i, int j) {
    return UniformDraw(kSeed, stream,
                       static_cast<std::uint64_t>((j % cells_y) * cells_x) +
                           static_cast<std::uint64_t>(i % cells_x))[0];
  };
  const double x = u * cells_x;
  const double y = v * cells_y;
  const int i = static_cast<int>(x);
  const int j = static_cast<int>(y);
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double a = smooth(x - i);
  const double b = smooth(y - j);
  return (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) +
         b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1));
}

using Shader = std::function<std::array<double, 3>(double u, double v)>;

TextureImage Paint(const char* material, int side, double size_m, const Shader& shader) {
  TextureImage image{material, side, side, size_m, {}, {}};
  std::array<double, 3> sum{};
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      const auto rgb = shader((column + 0.5) / side, (row + 0.5) / side);
      for (int k = 0; k < 3; ++k) {
        const double value = std::clamp(rgb[k], 0.0, 255.0);
        image.pixels.push_back(static_cast<std::uint8_t>(value));
        sum[k] += value;
      }
    }
  }
  for (int k = 0; k < 3; ++k) image.mean[k] = static_cast<std::uint8_t>(sum[k] / side / side);
  return image;
}

// Boards along u, each with its own shade and grain.
std::array<double, 3> Wood(double u, double v) {
  constexpr int kBoards = 8;
  const int board = static_cast<int>(v * kBoards);
  const double across = v * kBoards - board;
  const double shade = UniformDraw(kSeed, 1, static_cast<std::uint64_t>(board))[0];
  const double grain = Noise(2, u, v, 6, 160);
  const double broad = Noise(3, u, v, 4, 24);
  const double seam = std::min(across, 1 - across) < 0.02 ? 0.72 : 1.0;
  const double light = seam * (0.80 + 0.16 * shade + 0.14 * grain + 0.12 * broad);
  return {190 * light, 142 * light, 96 * light};
}

std::array<double, 3> Tile(double u, double v) {
  constexpr int kTiles = 4;
  const double x = u * kTiles - std::floor(u * kTiles);
  const double y = v * kTiles - std::floor(v * kTiles);
  const bool joint = std::min({x, y, 1 - x, 1 - y}) < 0.015;
  const bool dark = (static_cast<int>(u * kTiles) + static_cast<int>(v * kTiles)) % 2 == 0;
  const double light =
      (joint ? 0.66 : (dark ? 0.84 : 1.0)) * (0.94 + 0.12 * Noise(4, u, v, 32, 32));
  return {156 * light, 160 * light, 164 * light};
}

std::array<double, 3> Plaster(double u, double v) {
  const double light = 0.95 + 0.05 * Noise(5, u, v, 64, 64) + 0.05 * Noise(6, u, v, 9, 9);
  return {212 * light, 206 * light, 192 * light};
}

}  // namespace

std::vector<TextureImage> MakeTextures() {
  std::vector<TextureImage> images;
  images.push_back(Paint(kWoodMaterial, 1024, 0.8, Wood));
  images.push_back(Paint(kTileMaterial, 512, 1.6, Tile));
  images.push_back(Paint(kPlasterMaterial, 256, 1.0, Plaster));
  return images;
}

}  // namespace tsdfpp
