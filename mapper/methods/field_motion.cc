#include "mapper/methods/field_motion.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "mapper/volume/object_volume.h"
#include "mapper/volume/pull_back.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

// What lies in each of these blocks after the motion; nullptr where nothing does.
std::vector<std::unique_ptr<TsdfBlock>> Resample(const VoxelReader& reader, const Pose& T_inverse,
                                                 const MapConfig& config,
                                                 const std::vector<Index3>& touched) {
  const std::array<double, 12> T_inverse_rows = RowsOf(T_inverse);
  std::vector<std::unique_ptr<TsdfBlock>> arrivals(touched.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, touched.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          auto block = std::make_unique<TsdfBlock>();
          if (ResampleBlock(reader, T_inverse_rows, config.voxel_m, touched[i], *block,
                            config.resampling)) {
            arrivals[i] = std::move(block);
          }
        }
      },
      tbb::simple_partitioner());
  return arrivals;
}

// That of the voxel nearest to where a voxel came from.
std::uint16_t ConfidenceAt(const BlockGrid<LabelledField::LabelBlock>& labels,
                           const Pose& T_inverse, double voxel_m, const Index3& v) {
  const Eigen::Vector3d q = T_inverse * (Eigen::Vector3d(v.x, v.y, v.z) * voxel_m) / voxel_m;
  const auto nearest = [](double x) {  // as ResampleBlock takes it
    return static_cast<int>(std::floor(x)) +
           (static_cast<float>(x - std::floor(x)) >= 0.5F ? 1 : 0);
  };
  const Index3 from{nearest(q.x()), nearest(q.y()), nearest(q.z())};
  return labels.Find(BlockOf(from))->confidence[static_cast<std::size_t>(PlaceInBlock(from))];
}

}  // namespace

void MoveInField(InstanceId id, const Pose& T_rel, const MapConfig& config, bool keep_nearer,
                 LabelledField& field) {
  const LabelledField::Part source = field.PartOf(id);
  const std::vector<Index3> left = field.Vacate(id, RemovedVoxels::kUnobserved);
  const VoxelReader reader(source.values);
  const Pose T_inverse = T_rel.inverse();
  const std::vector<Index3> touched = BlocksTouchedBy(reader, T_rel, config.voxel_m);
  const auto arrivals = Resample(reader, T_inverse, config, touched);
  for (std::size_t b = 0; b < touched.size(); ++b) {
    if (arrivals[b] == nullptr) continue;
    const auto confidence = [&](std::size_t i) {
      return ConfidenceAt(source.labels, T_inverse, config.voxel_m,
                          VoxelAt(touched[b], static_cast<int>(i)));
    };
    field.Arrive(id, touched[b], *arrivals[b], keep_nearer, confidence);
  }
  field.FreeEmpty(left);
}

}  // namespace tsdfpp
