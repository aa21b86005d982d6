// What each map writes to a file and reads from it (docs/map.md, "The map file").
#include "mapper/index/cover.h"
#include "mapper/methods/anchored_map.h"
#include "mapper/methods/literal_map.h"
#include "mapper/methods/single_field_map.h"
#include "mapper/methods/tsdfpp_map.h"
#include "mapper/methods/volume_store.h"
#include "mapper/methods/volumes_map.h"

namespace tsdfpp {
namespace {

constexpr const char* kVolumes = "VOLS";
constexpr const char* kLists = "LIST";
constexpr const char* kField = "FIEL";
constexpr const char* kLabels = "LABL";
constexpr const char* kPoses = "POSE";

Expected<ObjectVolumes> LoadAllVolumes(const Sections& sections, const MapConfig& config) {
  ByteReader bytes(sections.at(kVolumes));
  TSDFPP_ASSIGN(ObjectVolumes volumes, LoadVolumes(bytes, config));
  if (!bytes.AtEnd()) return DataError("its volumes have another length than they say");
  return volumes;
}

// Of methods that move values, whose objects have no pose at birth to place a lattice by.
Expected<void> CheckWorldLattices(const ObjectVolumes& volumes) {
  for (const auto& [id, volume] : volumes) {
    if (volume.T_WO_birth) {
      return DataError("object {} has a lattice of its own, expected the world's", id);
    }
  }
  return {};
}

// Of methods that move lattices: the first pose is the one at birth.
Expected<void> CheckOwnLattices(const ObjectVolumes& volumes) {
  for (const auto& [id, volume] : volumes) {
    if (volume.T_WO && !volume.T_WO_birth) {
      return DataError("object {} has a pose and none at birth, so its lattice is nowhere", id);
    }
  }
  return {};
}

Expected<std::vector<ListsOfBlock>> LoadAllLists(const Sections& sections, const char* name,
                                                 int layers, const MapConfig& config) {
  ByteReader bytes(sections.at(name));
  TSDFPP_ASSIGN(std::vector<ListsOfBlock> lists, LoadLists(bytes, layers, config.confidence_cap));
  if (!bytes.AtEnd()) return DataError("its lists have another length than they say");
  return lists;
}

// holds(id, index, place) has to be true of every listing.
template <typename Holds>
Expected<void> CheckListings(const ListsOfBlock& lists, int layers, const Holds& holds) {
  for (std::size_t i = 0; i < lists.entries.size(); ++i) {
    const InstanceId id = lists.entries[i].id;
    if (id == kNoInstance) continue;
    if (!holds(id, lists.index, static_cast<int>(i) / layers)) {
      return DataError("object {} is listed where it is not", id);
    }
  }
  return {};
}

// A matrix row by row, from one column by column of `columns` columns; and the other way round with
// the number of rows.
std::vector<ListEntry> Transposed(const std::vector<ListEntry>& entries, std::size_t columns) {
  const std::size_t rows = entries.size() / columns;
  std::vector<ListEntry> transposed(entries.size());
  for (std::size_t column = 0; column < columns; ++column) {
    for (std::size_t row = 0; row < rows; ++row) {
      transposed[row * columns + column] = entries[column * rows + row];
    }
  }
  return transposed;
}

}  // namespace

void LayeredMap::Save(Sections& sections) const { SaveVolumes(volumes_, sections[kVolumes]); }

Expected<void> LayeredMap::Load(const Sections& sections) {
  TSDFPP_ASSIGN(volumes_, LoadAllVolumes(sections, config_));
  return {};
}

void TsdfppMap::Save(Sections& sections) const {
  LayeredMap::Save(sections);
  std::vector<ListsOfBlock> lists;
  for (const auto* entry : index_.Sorted()) {
    std::vector<ListEntry> entries(static_cast<std::size_t>(kBlockVoxels * layers_));
    for (std::size_t i = 0; i < entry->block->ids.size(); ++i) entries[i] = entry->block->At(i);
    lists.push_back({entry->index, Transposed(entries, static_cast<std::size_t>(layers_))});
  }
  SaveLists(lists, layers_, sections[kLists]);
}

Expected<void> TsdfppMap::Load(const Sections& sections) {
  TSDFPP_RETURN_IF_ERROR(LayeredMap::Load(sections));
  TSDFPP_RETURN_IF_ERROR(CheckWorldLattices(volumes_));
  for (const auto& [id, volume] : volumes_) RenewCovers(volume.grid);
  TSDFPP_ASSIGN(const std::vector<ListsOfBlock> lists,
                LoadAllLists(sections, kLists, layers_, config_));
  const auto covers = [this](InstanceId id, const Index3& index, int place) {
    const auto volume = volumes_.find(id);
    if (volume == volumes_.end()) return false;
    const TsdfBlock* block = volume->second.grid.Find(index);
    return block != nullptr && Bit(block->cover, place);
  };
  for (const ListsOfBlock& block : lists) {
    TSDFPP_RETURN_IF_ERROR(CheckListings(block, layers_, covers));
    ListBlock& added = ListsOf(block.index);
    added.Resize(static_cast<std::size_t>(layers_));
    const std::vector<ListEntry> entries = Transposed(block.entries, kBlockVoxels);
    for (std::size_t i = 0; i < entries.size(); ++i) {
      added.ids[i] = entries[i].id;
      added.confidences[i] = static_cast<std::uint8_t>(entries[i].confidence);
    }
    FreeEmptyLayers(added);
  }
  return {};
}

Expected<void> VolumesMap::Load(const Sections& sections) {
  TSDFPP_RETURN_IF_ERROR(LayeredMap::Load(sections));
  return CheckOwnLattices(volumes_);
}

Expected<void> AnchoredMap::Load(const Sections& sections) {
  TSDFPP_RETURN_IF_ERROR(LayeredMap::Load(sections));
  TSDFPP_RETURN_IF_ERROR(CheckOwnLattices(volumes_));
  for (const auto& [id, volume] : volumes_) moved_.push_back(id);
  RefreshIndex();
  return {};
}

void LiteralMap::Save(Sections& sections) const {
  SaveVolumes(volumes_, sections[kVolumes]);
  std::vector<ListsOfBlock> lists;
  for (const auto* entry : lists_.Sorted()) {
    ListsOfBlock& block = lists.emplace_back();
    block.index = entry->index;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      for (const Entry& of : {entry->block->active[i], entry->block->inactive[i]}) {
        block.entries.push_back({of.id, of.confidence});
      }
    }
  }
  SaveLists(lists, 2, sections[kLists]);
}

Expected<void> LiteralMap::Load(const Sections& sections) {
  active_.all_are_stale = true;
  TSDFPP_ASSIGN(volumes_, LoadAllVolumes(sections, config_));
  TSDFPP_RETURN_IF_ERROR(CheckWorldLattices(volumes_));
  TSDFPP_ASSIGN(const std::vector<ListsOfBlock> lists, LoadAllLists(sections, kLists, 2, config_));
  const auto is_observed = [this](InstanceId id, const Index3& index, int place) {
    const auto volume = volumes_.find(id);
    if (volume == volumes_.end()) return false;
    const TsdfBlock* block = volume->second.grid.Find(index);
    return block != nullptr && Bit(block->observed, place);
  };
  for (const ListsOfBlock& block : lists) {
    TSDFPP_RETURN_IF_ERROR(CheckListings(block, 2, is_observed));
    ListBlock& to = lists_.FindOrAdd(block.index);
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      to.active[i] = {block.entries[2 * i].id, block.entries[2 * i].confidence};
      to.inactive[i] = {block.entries[2 * i + 1].id, block.entries[2 * i + 1].confidence};
    }
  }
  return {};
}

void SingleFieldMap::Save(Sections& sections) const {
  SaveGrid(field_, sections[kField]);
  std::vector<ListsOfBlock> lists;
  for (const auto* entry : labels_.Sorted()) {
    ListsOfBlock block{entry->index, {}};
    bool any = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      block.entries.push_back(
          {entry->block->id[i], static_cast<std::int16_t>(entry->block->confidence[i])});
      any = any || entry->block->id[i] != kNoInstance;
    }
    if (any) lists.push_back(std::move(block));
  }
  SaveLists(lists, 1, sections[kLabels]);
  std::string& poses = sections[kPoses];
  PutBytes(static_cast<std::uint32_t>(T_WO_.size()), poses);
  for (const auto& [id, T_WO] : T_WO_) {
    PutBytes(id, poses);
    SavePose(T_WO, poses);
  }
}

Expected<void> SingleFieldMap::Load(const Sections& sections) {
  ByteReader field(sections.at(kField));
  TSDFPP_ASSIGN(field_, LoadGrid(field, config_));
  if (!field.AtEnd()) return DataError("its field has another length than it says");
  for (const auto& entry : field_.entries()) labels_.FindOrAdd(entry.index);
  TSDFPP_ASSIGN(const std::vector<ListsOfBlock> lists, LoadAllLists(sections, kLabels, 1, config_));
  const auto is_observed = [this](InstanceId, const Index3& index, int place) {
    const TsdfBlock* block = field_.Find(index);
    return block != nullptr && Bit(block->observed, place);
  };
  for (const ListsOfBlock& block : lists) {
    TSDFPP_RETURN_IF_ERROR(CheckListings(block, 1, is_observed));
    LabelBlock& labels = *labels_.Find(block.index);
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      labels.id[i] = block.entries[i].id;
      labels.confidence[i] = static_cast<std::uint16_t>(block.entries[i].confidence);
      if (labels.id[i] == kNoInstance) continue;
      if (labels.confidence[i] == 0) return DataError("a label has no confidence");
      labels.ever |= EverBit(labels.id[i]);
    }
  }
  ByteReader poses(sections.at(kPoses));
  const auto count = poses.Get<std::uint32_t>();
  for (std::uint32_t i = 0; i < count && poses.ok(); ++i) {
    const auto id = poses.Get<InstanceId>();
    TSDFPP_ASSIGN(const Pose T_WO, LoadPose(poses, LatticeRange(config_.voxel_m)));
    T_WO_.insert_or_assign(id, T_WO);
  }
  if (!poses.AtEnd()) return DataError("its poses have another length than they say");
  return {};
}

}  // namespace tsdfpp
