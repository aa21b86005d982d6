// The arithmetic of reading one lattice at the voxels of a block of another (docs/map.md, "Lattice"
// and "Resampling"), in loops that are compiled for several instruction sets.
#pragma once

#include <array>
#include <cstdint>

#include "mapper/volume/patch_kernels.h"

namespace tsdfpp {

// The points (T * (h v)) / h of the block's voxels v; `T` holds the rows of a rigid 3x4 matrix, h
// is `voxel_m`.
void PullBackPoints(const std::array<double, 12>& T, double voxel_m, const Index3& first,
                    PulledPoints& points);

// Trilinear interpolation at the points that `wanted` marks. Corners with a coefficient of zero do
// not count; `out` is NaN where a corner that counts is NaN, and means nothing at other points.
void InterpolateCounted(const PatchValues& values, const PulledPoints& points,
                        const BlockMask& wanted, float* out);

// The same where all eight corners count.
void InterpolateAll(const PatchValues& values, const PulledPoints& points, const BlockMask& wanted,
                    float* out);

// The same over the corners that are not NaN, whose coefficients are made to sum to 1; where none
// is NaN, as InterpolateAll.
void InterpolateObserved(const PatchValues& values, const PulledPoints& points,
                         const BlockMask& wanted, float* out);

// Those of `wanted` whose distance is a number, and in [-back, 0) or `in_crossed` marks the point.
BlockMask Covered(const BlockMask& wanted, const BlockMask& in_crossed, const float* distance,
                  float back);

// Distances and weights at the points that `wanted` marks, 0 elsewhere: rounded to what a block
// stores.
void PutValues(const BlockMask& wanted, const float* distance, const float* weight,
               TsdfBlock& block);

// Into the colours of a block, at the points that `wanted` marks: means of three channels over the
// corners with `count` > 0, weighted by the trilinear coefficients, rounded; `points_count` are the
// interpolated counts. 0 where a rounded count is 0 or no corner is coloured.
void PutColours(const std::array<PatchValues, 3>& channels, const PatchValues& count,
                const PulledPoints& points, const BlockMask& wanted, const float* points_count,
                TsdfBlock& block);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::PullBackPoints) PullBackPoints;
decltype(tsdfpp::InterpolateCounted) InterpolateCounted;
decltype(tsdfpp::InterpolateAll) InterpolateAll;
decltype(tsdfpp::InterpolateObserved) InterpolateObserved;
decltype(tsdfpp::Covered) Covered;
decltype(tsdfpp::PutValues) PutValues;
decltype(tsdfpp::PutColours) PutColours;
}  // namespace plain

}  // namespace tsdfpp
