#include "sim/models/textures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "core/random.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kTextureSeed = 7;

// Smooth noise in [0, 1): random numbers on a lattice of `cells_x` by `cells_y` that wraps around,
// joined by smoothsteps. u and v in [0, 1).
double Noise(std::uint32_t stream, double u, double v, int cells_x, int cells_y,
             std::uint64_t seed = kTextureSeed) {
  const auto at = [&](int i, int j) {
    return UniformDraw(seed, stream,
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

TextureImage Paint(const std::string& material, int side, double size_m, const Shader& shader) {
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
  const double shade = UniformDraw(kTextureSeed, 1, static_cast<std::uint64_t>(board))[0];
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

// Streams of random numbers, apart from those of the room's pictures above.
constexpr std::uint32_t kPatternStream = 101;  // and the two after it
constexpr std::uint32_t kSpeckleStream = 104;
constexpr std::uint32_t kTextureChoiceStream = 105;
constexpr std::uint32_t kPaintStream = 108;

double Smooth(double low, double high, double t) {
  const double s = std::clamp((t - low) / (high - low), 0.0, 1.0);
  return s * s * (3 - 2 * s);
}

double Fraction(double t) { return t - std::floor(t); }

// Noise of several octaves, about 0 to 1.
double Turbulence(std::uint64_t seed, double u, double v, int cells) {
  double sum = 0;
  double weight = 0.5;
  for (std::uint32_t octave = 0; octave < 3; ++octave) {
    sum += weight * Noise(kPatternStream + octave, u, v, cells << octave, cells << octave, seed);
    weight /= 2;
  }
  return sum / 0.875;
}

// A pattern gives the share of the second colour, 0 to 1, at a point of the picture.
using Pattern = double (*)(std::uint64_t seed, double u, double v);

double Checker(std::uint64_t /*seed*/, double u, double v) {
  constexpr int kSquares = 4;
  return (static_cast<int>(u * kSquares) + static_cast<int>(v * kSquares)) % 2;
}

double Stripes(std::uint64_t /*seed*/, double /*u*/, double v) {
  constexpr int kStripes = 5;
  return Fraction(v * kStripes) < 0.4 ? 1 : 0;
}

double Dots(std::uint64_t /*seed*/, double u, double v) {
  constexpr int kDots = 3;
  // Two lattices, the second in the middle of the first's cells.
  double nearest = 1;
  for (const double shift : {0.0, 0.5}) {
    const double x = Fraction(u * kDots + shift) - 0.5;
    const double y = Fraction(v * kDots + shift) - 0.5;
    nearest = std::min(nearest, std::sqrt(x * x + y * y));
  }
  return 1 - Smooth(0.19, 0.22, nearest);
}

double Bricks(std::uint64_t seed, double u, double v) {
  constexpr int kRows = 8;
  constexpr int kColumns = 4;
  const int row = static_cast<int>(v * kRows);
  const double along = Fraction(u + (row % 2) * 0.5 / kColumns) * kColumns;
  const double x = Fraction(along);
  const double y = Fraction(v * kRows);
  if (std::min(x, 1 - x) < 0.03 || std::min(y, 1 - y) < 0.07) return 1;  // mortar
  const auto brick = static_cast<std::uint64_t>(row * kColumns + static_cast<int>(along));
  return 0.25 * UniformDraw(seed, kPatternStream, brick)[0] + 0.12 * Turbulence(seed, u, v, 16);
}

double Planks(std::uint64_t seed, double u, double v) {
  constexpr int kPlanks = 4;
  const int plank = static_cast<int>(v * kPlanks);
  const double across = Fraction(v * kPlanks);
  if (std::min(across, 1 - across) < 0.02) return 1;
  const double shade = UniformDraw(seed, kPatternStream, static_cast<std::uint64_t>(plank))[0];
  return 0.25 * shade + 0.35 * Noise(kPatternStream + 1, u, v, 4, 96, seed) +
         0.15 * Noise(kPatternStream + 2, u, v, 3, 16, seed);
}

double Marble(std::uint64_t seed, double u, double v) {
  const double wave = Fraction(u + 2 * v + 1.6 * Turbulence(seed, u, v, 4));
  const double vein = 1 - std::abs(2 * wave - 1);  // 1 in a vein's middle
  return 0.9 * Smooth(0.75, 1.0, vein) + 0.25 * Turbulence(seed, v, u, 6);
}

double Clouds(std::uint64_t seed, double u, double v) {
  return Smooth(0.2, 0.8, Turbulence(seed, u, v, 6));
}

double Speckle(std::uint64_t seed, double u, double v) {
  constexpr int kCells = 24;
  const int i = static_cast<int>(u * kCells);
  const int j = static_cast<int>(v * kCells);
  // One chip in most cells, well inside it, so that none crosses the picture's border.
  const auto chip = UniformDraw(seed, kSpeckleStream, static_cast<std::uint64_t>(j * kCells + i));
  const double x = Fraction(u * kCells) - (0.35 + 0.3 * chip[0]);
  const double y = Fraction(v * kCells) - (0.35 + 0.3 * chip[1]);
  const double radius = 0.34 * chip[2];
  return x * x + y * y < radius * radius ? 0.5 + 0.5 * chip[3] : 0.08 * chip[3];
}

double Weave(std::uint64_t /*seed*/, double u, double v) {
  constexpr int kThreads = 16;
  const double x = Fraction(u * kThreads);
  const double y = Fraction(v * kThreads);
  const bool over = (static_cast<int>(u * kThreads) + static_cast<int>(v * kThreads)) % 2 == 0;
  const double across = over ? y : x;
  return (over ? 0.15 : 0.6) + 1.2 * (across - 0.5) * (across - 0.5);
}

struct NamedPattern {
  const char* name;
  Pattern pattern;
};
constexpr std::array<NamedPattern, 9> kPatterns{{{"checker", Checker},
                                                 {"stripes", Stripes},
                                                 {"dots", Dots},
                                                 {"bricks", Bricks},
                                                 {"planks", Planks},
                                                 {"marble", Marble},
                                                 {"noise", Clouds},
                                                 {"speckle", Speckle},
                                                 {"weave", Weave}}};

// hue 0 to 6, the others 0 to 1.
Colour FromHsv(double hue, double saturation, double value) {
  const auto channel = [&](double shift) {
    const double k = std::fmod(shift + hue, 6.0);
    const double share = std::clamp(std::min(k, 4 - k), 0.0, 1.0);
    return static_cast<std::uint8_t>(255 * value * (1 - saturation * share) + 0.5);
  };
  return {channel(5), channel(3), channel(1)};
}

double Luminance(const Colour& c) { return 0.3 * c[0] + 0.59 * c[1] + 0.11 * c[2]; }

}  // namespace

std::vector<TextureImage> MakeTextures() {
  std::vector<TextureImage> images;
  images.push_back(Paint(kWoodMaterial, 1024, 0.8, Wood));
  images.push_back(Paint(kTileMaterial, 512, 1.6, Tile));
  images.push_back(Paint(kPlasterMaterial, 256, 1.0, Plaster));
  return images;
}

const std::vector<std::string>& TexturePatternNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const NamedPattern& named : kPatterns) all.emplace_back(named.name);
    return all;
  }();
  return names;
}

Expected<TextureImage> MakeTexture(const TextureSpec& spec) {
  const auto* named =
      std::find_if(kPatterns.begin(), kPatterns.end(),
                   [&](const NamedPattern& candidate) { return candidate.name == spec.pattern; });
  if (named == kPatterns.end()) {
    return UsageError("there is no pattern '{}', expected one of {}", spec.pattern,
                      fmt::join(TexturePatternNames(), ", "));
  }
  if (!(spec.size_m > 0) || !std::isfinite(spec.size_m)) {
    return UsageError("a texture's size_m is {}, expected a positive number of metres",
                      spec.size_m);
  }
  if (spec.side_px < kLeastTextureSide_px || spec.side_px > kMostTextureSide_px) {
    return UsageError("a texture's side_px is {}, expected {} to {}", spec.side_px,
                      kLeastTextureSide_px, kMostTextureSide_px);
  }
  const Colour& a = spec.first;
  const Colour& b = spec.second;
  const std::string name =
      fmt::format("{}-{}-{:02x}{:02x}{:02x}-{:02x}{:02x}{:02x}-{}-{}", spec.pattern, spec.seed,
                  a[0], a[1], a[2], b[0], b[1], b[2], spec.size_m, spec.side_px);
  return Paint(name, spec.side_px, spec.size_m, [&](double u, double v) {
    const double share = std::clamp(named->pattern(spec.seed, u, v), 0.0, 1.0);
    std::array<double, 3> rgb{};
    for (std::size_t k = 0; k < 3; ++k) rgb[k] = (1 - share) * a[k] + share * b[k];
    return rgb;
  });
}

Colour DrawPaint(std::uint64_t seed, std::uint64_t index) {
  const auto draw = UniformDraw(seed, kPaintStream, index);
  return FromHsv(6 * draw[0], 0.3 + 0.6 * draw[1], 0.45 + 0.5 * draw[2]);
}

TextureSpec DrawTexture(std::uint64_t seed, std::uint64_t index) {
  constexpr double kLeastContrast = 45;  // of the two colours' luminance, of 255
  const auto choice = UniformDraw(seed, kTextureChoiceStream, index);
  TextureSpec spec;
  spec.pattern = kPatterns[static_cast<std::size_t>(choice[0] * kPatterns.size())].name;
  spec.seed = static_cast<std::uint64_t>(choice[1] * 1e6);
  spec.size_m = 0.05 + 0.25 * choice[2];
  const auto first = UniformDraw(seed, kTextureChoiceStream + 1, index);
  const auto second = UniformDraw(seed, kTextureChoiceStream + 2, index);
  spec.first = FromHsv(6 * first[0], 0.45 * first[1], 0.5 + 0.45 * first[2]);
  spec.second = FromHsv(6 * second[0], 0.1 + 0.5 * second[1], 0.25 + 0.7 * second[2]);
  const double gap = Luminance(spec.first) - Luminance(spec.second);
  if (std::abs(gap) < kLeastContrast) {
    // The second one is the first in another shade.
    const double factor = Luminance(spec.first) > 110 ? 0.45 : 1.7;
    for (std::size_t k = 0; k < 3; ++k) {
      spec.second[k] = static_cast<std::uint8_t>(std::min(255.0, 20 + factor * spec.first[k]));
    }
    if (std::abs(Luminance(spec.first) - Luminance(spec.second)) < kLeastContrast) {
      spec.second = {16, 16, 20};
    }
  }
  return spec;
}

}  // namespace tsdfpp
