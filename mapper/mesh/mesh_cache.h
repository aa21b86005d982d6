// The mesh of a grid, kept block by block, so that only what changed is made again. It is the same,
// byte for byte, as the mesh made from scratch (docs/map.md, "Marching cubes").
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "mapper/mesh/mesh_part.h"
#include "mapper/mesh/scene_changes.h"

namespace tsdfpp {

class GridMesh {
 public:
  GridMesh() = default;
  GridMesh(const GridMesh&) = delete;
  GridMesh(GridMesh&&) noexcept = default;
  GridMesh& operator=(const GridMesh&) = delete;
  GridMesh& operator=(GridMesh&&) noexcept = default;
  ~GridMesh() = default;

  // Brings the parts in line with the grid, whichever grid that is; `voxel` in metres, always the
  // same. A block counts as changed where its revision is another one; none is looked at where
  // `revision`, which names the values of all, is that of the last update.
  MeshWork Update(const TsdfGrid& grid, float voxel, std::optional<std::uint64_t> revision = {});

  // By block, in Index3's order. The caller may change what a part says of the scene.
  const std::vector<MeshPart*>& parts() const { return order_; }
  // PackIndex of their blocks, in the same order.
  const std::vector<std::uint64_t>& keys() const { return keys_; }

  // Of the last update: the parts that were made again, and the blocks whose values changed, new
  // and erased ones too.
  const std::vector<MeshPart*>& remade() const { return remade_; }
  const std::vector<Index3>& changed() const { return changed_; }

  // The parts whose triangles, or values beside these, changed since this was last asked: what the
  // scene adds to them is to be found again, and noted by `is_settled`.
  std::vector<MeshPart*> TakeUnsettled();

  // For somebody who follows the scene: notes that parts look different now, or where they are is
  // different. Costs nothing until changes were taken once.
  void NoteChanges(const std::vector<MeshPart*>& parts);
  // The parts noted since the last time, all the first time, in Index3's order, and the blocks of
  // those that were shown and are no more. The caller keeps MeshPart::is_shown.
  struct Changes {
    std::vector<MeshPart*> parts;
    std::vector<Index3> gone;
  };
  Changes TakeChanges();
  // The blocks of which the follower has triangles, those that are gone among them.
  std::vector<Index3> ShownBlocks() const;

  // The part of a block, nullptr where there is none.
  MeshPart* PartAt(const Index3& block) const;

  // Bytes of parts and of what they hold.
  std::size_t Bytes() const;

 private:
  using Parts = std::vector<MeshPart*>;
  // What a part was made from. These lie together, because each update compares them all.
  struct Seen {
    Index3 index;
    const TsdfBlock* block = nullptr;
    std::uint64_t revision = 0;
  };

  // What a comparison found of a block.
  enum Change : std::uint8_t { kSame, kValues, kMasks };
  bool Compare(const TsdfGrid& grid, std::vector<Change>& change);
  // The part of a block that is not where it was among the grid's entries.
  struct Spare {
    std::uint64_t key;
    Seen seen;
    std::unique_ptr<MeshPart> part;
  };
  std::size_t CountInPlace(const TsdfGrid& grid) const;
  std::vector<Spare> TakeSpares(std::size_t first);
  void Forget(const std::vector<Spare>& erased);
  void Order();
  void MatchBlocks(const TsdfGrid& grid);
  void Link();
  void Mark(MeshPart* part, std::uint32_t what, Parts& list);
  template <typename Offsets>
  void MarkAround(MeshPart& part, const Offsets& offsets, std::uint32_t what, Parts& list);
  void MarkChanged(const std::vector<Change>& change);
  bool Misses(const TsdfGrid& grid);
  void RemakeCubesAndEdges();
  void Finish(Parts& list);
  void Unsettle(MeshPart& part);

  std::vector<std::unique_ptr<MeshPart>> owned_;  // part i is that of the grid's entry i
  std::vector<Seen> seen_;                        // of owned_
  std::optional<std::uint64_t> revision_;         // of the whole grid, if it was told
  Parts order_;
  std::vector<std::uint64_t> keys_;
  Parts cubes_todo_;
  Parts edges_todo_;
  Parts vertices_todo_;
  Parts triangles_todo_;
  Parts remade_;
  Parts unsettled_;
  std::vector<Index3> changed_;
  bool is_followed_ = false;
  Parts pending_;
  std::vector<Index3> gone_;  // shown when they were erased
};

}  // namespace tsdfpp
