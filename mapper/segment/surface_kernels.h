// The inner loops of the surface's maps over one row of pixels. Formulae:
// docs/segmentation.md, "Maps". No arrays overlap.
#pragma once

#include <cstddef>
#include <cstdint>

#include "mapper/segment/depth_noise.h"

namespace tsdfpp {

// Adds to `sum` and `count` those pairs `before`, `behind`, i pixels from `q`, that noise alone may
// part from it.
struct PairScale {
  float noise = 0;     // NoiseModel::scale
  float sigmas = 0;    // config.sigmas sqrt(6)
  float shift = 0;     // noise across the ray / 2 i: of the difference of a pair
  float steepest = 0;  // noise across the ray times the steepest slope: of q
};
void AddPairs(const float* before, const float* q, const float* behind, std::size_t pixels,
              const PairScale& scale, float* sum, float* count);

// Normals, three numbers a pixel, and the noise along the ray, 0 where q is; from the values s
// pixels before and after a pixel, above and below it, 0 where there is none.
struct NormalScale {
  float noise = 0;        // NoiseModel::scale
  float sigmas = 0;       // config.sigmas
  float pixel_width = 0;  // w
  float per_step = 0;     // 1 / s
  float per_x = 0;        // fx
  float per_y = 0;        // fy
};
struct NormalRow {
  const float* q;
  const float* before;
  const float* after;
  const float* above;
  const float* below;
  const float* ray_x;
  float ray_y;
};
void NormalsOfRow(const NormalRow& row, std::size_t pixels, const NormalScale& scale, float* normal,
                  float* sigma);

// 0 where there is a jump between q0 and q1, else 1; `before` are the values s pixels before q0,
// `behind` those s pixels behind q1, 0 where there is none.
struct JumpScale {
  float noise = 0;     // of sigma
  float width = 0;     // config.jump_px w
  float per_step = 0;  // 1 / s
  float steepest = 0;  // w times the steepest slope
};
struct JumpRow {
  const float* before;
  const float* q0;
  const float* q1;
  const float* behind;
  const float* sigma0;
  const float* sigma1;
};
void LinksOfRow(const JumpRow& row, std::size_t pixels, const JumpScale& scale,
                std::uint8_t* linked);

// 255 where a chord turns towards the camera by more than the limit, else 0. A chord's points lie
// in a plane with the camera: their coordinates in it are z * along, and z * slant in depth.
struct ChordScale {
  float tangent = 0;  // tan(config.concave_deg)
  float noise = 0;    // of sigma z
};
struct ChordRow {
  const float* z0;      // s pixels before
  const float* z;       // here
  const float* z1;      // s pixels behind
  const float* along0;  // coordinates of their rays along the chord: of each pixel, or the same for
  const float* along;   // all, in steps of `stride`, which is 1 or 0
  const float* along1;
  std::size_t stride;
  const float* slant;  // sqrt(1 + the other coordinate squared), in steps of 1 - stride
  const float* sigma;
};
void TurnsOfRow(const ChordRow& row, std::size_t pixels, const ChordScale& scale,
                std::uint8_t* turns);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::AddPairs) AddPairs;
decltype(tsdfpp::NormalsOfRow) NormalsOfRow;
decltype(tsdfpp::LinksOfRow) LinksOfRow;
decltype(tsdfpp::TurnsOfRow) TurnsOfRow;
}  // namespace plain

}  // namespace tsdfpp
