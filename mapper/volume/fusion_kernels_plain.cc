// Observation and fusion voxel by voxel, as docs/map.md has them: "Observation of a voxel", "Fusion
// of an observation into a voxel", the contradiction of "tsdf++", the votes and guards of "tsdf".
// What a caller knows beforehand (BlockPlace::behind_m and all_in_view, FusionRule::one_label) and
// the block that comes next are of no use here.
#include <cmath>
#include <optional>

#include "core/types.h"
#include "mapper/volume/cube_masks.h"
#include "mapper/volume/fuse_voxel.h"
#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp::plain {
namespace {

// What the frame says of a voxel in view.
struct Sight {
  std::int32_t pixel = 0;  // row-major
  float distance = 0;      // s, metres; -infinity where the pixel's depth is not valid
  InstanceId label = kNoInstance;
};

// The frame at the voxel at place i of the block; nothing where it is out of view.
std::optional<Sight> Observe(const KernelFrame& frame, const BlockPlace& place, int i) {
  const float p_x = static_cast<float>(place.first.x + (i & 7)) * place.voxel;
  const float p_y = static_cast<float>(place.first.y + ((i >> 3) & 7)) * place.voxel;
  const float p_z = static_cast<float>(place.first.z + (i >> 6)) * place.voxel;
  const auto in_camera = [&](const float* row) {
    return ((row[1] * p_y + row[2] * p_z) + row[3]) + row[0] * p_x;
  };
  const float x = in_camera(place.T_CL);
  const float y = in_camera(place.T_CL + 4);
  const float z = in_camera(place.T_CL + 8);
  if (!(z >= kNearest_m)) return std::nullopt;

  const auto [fx, fy, cx, cy] = frame.intrinsics;
  const float iz = 1 / z;
  const float u = (fx * x) * iz + cx + 0.5F;
  const float v = (fy * y) * iz + cy + 0.5F;
  if (!(u >= 0 && u < frame.width && v >= 0 && v < frame.height)) return std::nullopt;

  Sight sight;
  // Numbers that are not negative: cutting off is the floor.
  sight.pixel = static_cast<std::int32_t>(v) * static_cast<std::int32_t>(frame.width) +
                static_cast<std::int32_t>(u);
  const float ray = std::sqrt((x * x + y * y) + z * z);
  sight.distance = (frame.depth[sight.pixel] - z) * (ray * iz);
  sight.label = frame.label[sight.pixel];
  return sight;
}

bool IsInFrontOfBackBand(const Sight& sight, float back) {
  return sight.distance >= -back && sight.label != kNoInstance;
}

void SetBitTo(BlockMask& mask, int place, bool value) {
  const std::uint64_t bit = 1ULL << static_cast<unsigned>(place & 63);
  std::uint64_t& slice = mask[static_cast<std::size_t>(place >> 6)];
  slice = value ? slice | bit : slice & ~bit;
}

// The fusion of a frame into one block.
class Fusion {
 public:
  Fusion(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
         TsdfBlock& block, LabelVotes* votes)
      : frame_(frame), place_(place), rule_(rule), block_(block), votes_(votes) {}

  FusionResult Run() {
    const BlockMask old_observed = block_.observed;
    const BlockMask old_negative = block_.negative;
    const BlockMask old_band = block_.band;
    for (int i = 0; i < kBlockVoxels; ++i) {
      const std::optional<Sight> sight = Observe(frame_, place_, i);
      if (!sight || !IsInFrontOfBackBand(*sight, rule_.back)) continue;
      if (votes_ != nullptr) {
        if (!IsHeld(i, *sight)) Take(i, *sight);
      } else if (sight->label == rule_.id) {
        Take(i, *sight);
      } else if (rule_.contradiction) {
        Contradict(i, sight->distance);
      }
    }
    if (any_cleared_) block_.FreeColoursIfNone();
    result_.changed_signs =
        plain::ChangedSigns(old_observed, old_negative, block_.observed, block_.negative);
    result_.band_changed = block_.band != old_band;
    return result_;
  }

 private:
  // Whether the voxel is another object's, at its surface or behind it, and nothing that is seen in
  // front of it may change it.
  bool IsHeld(int i, const Sight& sight) const {
    const InstanceId owner = votes_->id[i];
    return owner != kNoInstance && owner != sight.label && DistanceAt(i) <= votes_->guard &&
           sight.distance < 0;
  }

  // The observation is fused, in band or clamped.
  void Take(int i, const Sight& sight) {
    const float s = sight.distance;
    const bool in_band = s <= rule_.front;
    // Free space seen once more, that no longer counts observations, stays what it is.
    if (!in_band && Bit(block_.full, i) && DistanceAt(i) == rule_.front) return;
    if (in_band) {
      SetBit(result_.in_band, i);
      if (votes_ != nullptr && std::abs(s) <= votes_->band) Vote(i, sight.label);
    }
    const bool coloured = in_band && std::abs(s) <= ColourBandAt(i);
    const std::ptrdiff_t first_byte = 3 * static_cast<std::ptrdiff_t>(sight.pixel);
    const float facing = frame_.facing == nullptr ? 1 : frame_.facing[sight.pixel];
    FuseVoxel(block_, static_cast<std::size_t>(i), std::min(s * facing, rule_.front),
              coloured ? frame_.colour + first_byte : nullptr, rule_.weight_cap);
    Changed(i);
  }

  float ColourBandAt(int i) const {
    const bool has_colour = block_.ColourCount(static_cast<std::size_t>(i)) > 0;
    return has_colour ? rule_.colour_band : rule_.first_colour_band;
  }

  void Vote(int i, InstanceId seen) {
    std::uint16_t& label = votes_->id[i];
    std::uint16_t& confidence = votes_->confidence[i];
    if (label == seen) {
      confidence = static_cast<std::uint16_t>(std::min(confidence + 1, votes_->cap));
    } else if (label == kNoInstance || confidence < 2) {
      label = seen;
      confidence = 1;
      votes_->any_label_changed = true;
    } else {
      --confidence;
    }
  }

  // A pixel of another object sees through what the block's object claims to be solid.
  void Contradict(int i, float s) {
    const float half_inside = -0.5F * place_.voxel;
    const auto k = static_cast<std::size_t>(i);
    const bool claims_solid = block_.weight[k] > 0 && DistanceAt(i) < half_inside;
    if (!claims_solid || s < half_inside) return;
    block_.Clear(i);
    any_cleared_ = true;
    if (s > place_.voxel) {
      block_.distance[k] = std::min(s, rule_.front);
      block_.weight[k] = 1;
    }
    Changed(i);
  }

  // Brings the masks in line with the voxel's values.
  void Changed(int i) {
    const auto weight = static_cast<float>(block_.weight[static_cast<std::size_t>(i)]);
    const float distance = DistanceAt(i);
    const bool observed = weight > 0;
    SetBitTo(block_.observed, i, observed);
    SetBitTo(block_.negative, i, observed && distance < 0);
    SetBitTo(block_.band, i, observed && distance < 0 && distance >= -rule_.back);
    SetBitTo(block_.full, i, weight == rule_.weight_cap);
    result_.changed = true;
  }

  float DistanceAt(int i) const { return block_.distance[static_cast<std::size_t>(i)]; }

  const KernelFrame& frame_;
  const BlockPlace& place_;
  const FusionRule& rule_;
  TsdfBlock& block_;
  LabelVotes* votes_;
  FusionResult result_;
  bool any_cleared_ = false;
};

}  // namespace

bool ObserveVoxels(const KernelFrame& frame, const BlockPlace& place, float back,
                   BlockObservation& out) {
  bool any = false;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const std::optional<Sight> sight = Observe(frame, place, i);
    const bool observed = sight && IsInFrontOfBackBand(*sight, back);
    out.pixel[k] = observed ? sight->pixel : -1;
    if (observed) out.distance[k] = sight->distance;
    any = any || observed;
  }
  return any;
}

FusionResult FuseVoxels(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                        TsdfBlock& block, const TsdfBlock* /*next*/, LabelVotes* votes) {
  return Fusion(frame, place, rule, block, votes).Run();
}

}  // namespace tsdfpp::plain
