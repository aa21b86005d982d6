// Method `tsdf++`: the paper's map as a careful engineer would build it (docs/map.md).
#pragma once

#include "mapper/index/voxel_list.h"
#include "mapper/methods/layered_map.h"

namespace tsdfpp {

class TsdfppMap final : public LayeredMap {
 public:
  TsdfppMap(const MapConfig& config, int layers);

  Method method() const override { return Method::kTsdfpp; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  ObjectMove MoveTo(InstanceId id, const Pose& T_WO) const override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  Expected<void> Rename(InstanceId from, InstanceId to) override;
  Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                     const Pose& T_WO) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  std::optional<std::string> FindFault() const override;
  void Save(Sections& sections) const override;
  Expected<void> Load(const Sections& sections) override;

 protected:
  const InstanceId* ActiveIn(const Index3& block) const override;

 private:
  struct ListBlock {
    // Entry k of the list of voxel i at [k * kBlockVoxels + i]; as many layers as its longest list.
    std::vector<InstanceId> ids;
    std::vector<std::uint8_t> confidences;
    // Voxels where `settled_id` is active with full confidence, so that its votes change nothing.
    BlockMask settled{};
    InstanceId settled_id = kNoInstance;

    std::size_t layers() const { return ids.size() / kBlockVoxels; }
    // Takes no more room than that; new entries are empty.
    void Resize(std::size_t layers);
    ListEntry At(std::size_t i) const { return {ids[i], confidences[i]}; }
    InstanceId ActiveAt(int place) const { return ids[static_cast<std::size_t>(place)]; }
  };
  class Groups;

  ListBlock& ListsOf(const Index3& block);
  // To be changed: the voxel is no longer taken for settled.
  static VoxelList ListOf(ListBlock& lists, int place);
  // The same with room for one object more, unless it has K.
  VoxelList ListWithRoom(ListBlock& lists, int place) const;
  // True where another object is active than was.
  bool Vote(ListBlock& lists, InstanceId id, BlockMask votes) const;
  // The blocks of the index that lost a listing.
  std::vector<Index3> Deactivate(InstanceId id);
  // Puts the object first where it covers a voxel now.
  void Activate(InstanceId id);
  void UpdateIndex(const std::vector<FusedBlock>& fused);
  // Frees those of these blocks whose lists are all empty, and the last layers of the others where
  // they are.
  void FreeEmptyLists(const std::vector<Index3>& blocks);
  static void FreeEmptyLayers(ListBlock& lists);
  static bool IsEmpty(const ListBlock& lists);

  int layers_;
  BlockGrid<ListBlock> index_;
};

}  // namespace tsdfpp
