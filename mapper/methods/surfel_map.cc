#include "mapper/methods/surfel_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <numbers>

#include "mapper/map_reach.h"
#include "mapper/mesh/mesh_tools.h"
#include "mapper/methods/surfel_fusion.h"
#include "mapper/methods/surfel_rays.h"
#include "mapper/volume/object_volume.h"

namespace tsdfpp {
namespace {

constexpr std::uint32_t kCorners = 6;
constexpr std::size_t kTriangles = kCorners - 2;
constexpr std::size_t kSurfelsPerTask = 1024;
// Of the length of a normal in single precision.
constexpr float kUnitTolerance = 1e-5F;

// Where the object's frame is after a pose, if its lattice coincides with the world's at birth.
Pose LatticeAt(const SurfelObject& object, const Pose& T_WO) {
  return SameNumbers(*object.T_WO_birth, T_WO) ? Pose::Identity()
                                               : Pose(T_WO * object.T_WO_birth->inverse());
}

// Counter-clockwise seen from outside, from a corner that the normal alone decides.
std::array<Eigen::Vector3f, kCorners> HexagonOf(const Surfel& surfel, const Pose& T_WL) {
  const Eigen::Vector3d normal = surfel.normal.cast<double>();
  int flattest = 0;
  normal.cwiseAbs().minCoeff(&flattest);
  const Eigen::Vector3d right = normal.cross(Eigen::Vector3d::Unit(flattest)).normalized();
  const Eigen::Vector3d up = normal.cross(right);
  // From the middle to a corner, where the sides touch the disc.
  const double length = 2 / std::numbers::sqrt3 * static_cast<double>(surfel.radius_m);
  std::array<Eigen::Vector3f, kCorners> corners;
  for (std::uint32_t k = 0; k < kCorners; ++k) {
    const double angle = k * std::numbers::pi / 3;
    const Eigen::Vector3d p_L =
        surfel.centre.cast<double>() + length * (std::cos(angle) * right + std::sin(angle) * up);
    corners[k] = (T_WL * p_L).cast<float>();
  }
  return corners;
}

TriangleMesh MeshOf(const SurfelObject& object) {
  std::vector<const Surfel*> stable;
  for (const Surfel& surfel : object.surfels) {
    if (surfel.is_stable()) stable.push_back(&surfel);
  }
  TriangleMesh mesh;
  mesh.vertices.resize(kCorners * stable.size());
  mesh.colours.resize(kCorners * stable.size());
  mesh.triangles.resize(kTriangles * stable.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, stable.size(), kSurfelsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const auto first = static_cast<std::uint32_t>(kCorners * i);
          const auto corners = HexagonOf(*stable[i], object.T_WL);
          for (std::uint32_t k = 0; k < kCorners; ++k) {
            mesh.vertices[first + k] = corners[k];
            mesh.colours[first + k] = stable[i]->Rounded();
          }
          for (std::uint32_t t = 0; t < kTriangles; ++t) {
            mesh.triangles[kTriangles * i + t] = {first, first + t + 1, first + t + 2};
          }
        }
      },
      tbb::simple_partitioner());
  return mesh;
}

}  // namespace

void SurfelMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  SurfelObject& object = objects_[id];
  if (!object.T_WO_birth) object.T_WO_birth = T_WO;
  object.T_WO = T_WO;
  object.T_WL = LatticeAt(object, T_WO);
  object.lattice_is_world = SameNumbers(object.T_WL, Pose::Identity());
}

void SurfelMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  FuseIntoSurfels(frame, labels, config_, ++frames_, objects_);
}

std::unique_ptr<MapRepresentation> SurfelMap::Clone() const {
  return std::make_unique<SurfelMap>(*this);
}

std::vector<InstanceId> SurfelMap::Objects() const {
  std::vector<InstanceId> ids;
  for (const auto& [id, object] : objects_) {
    if (!object.surfels.empty()) ids.push_back(id);
  }
  return ids;
}

Pose SurfelMap::ObjectLattice(InstanceId id) const {
  const auto object = objects_.find(id);
  return object == objects_.end() ? Pose::Identity() : object->second.T_WL;
}

TriangleMesh SurfelMap::ObjectMesh(InstanceId id) const {
  const auto object = objects_.find(id);
  return object == objects_.end() ? TriangleMesh{} : MeshOf(object->second);
}

TriangleMesh SurfelMap::SceneMesh() const {
  TriangleMesh scene;
  for (const InstanceId id : Objects()) Append(scene, ObjectMesh(id), id);
  return scene;
}

std::vector<RaySurface> SurfelMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                            const RayCastOptions& options) const {
  return CastSurfels(objects_, camera, T_WC, options);
}

MapMemory SurfelMap::Memory() const {
  MapMemory memory;
  for (const auto& [id, object] : objects_) {
    memory.blocks += object.surfels.empty() ? 0 : 1;
    memory.bytes += sizeof(SurfelObject) + object.surfels.capacity() * sizeof(Surfel);
  }
  return memory;
}

std::optional<std::string> SurfelMap::FindFault() const {
  const double most_radius_m = kMostSurfelRadius_voxels * config_.voxel_m;
  for (const auto& [id, object] : objects_) {
    for (std::size_t i = 0; i < object.surfels.size(); ++i) {
      const Surfel& surfel = object.surfels[i];
      // Named anew: clang 14 lets no lambda have a name that a declaration took apart.
      const auto fault = [i, of = id](std::string_view what) {
        return fmt::format("surfel {} of object {} {}", i, of, what);
      };
      if (!surfel.centre.allFinite()) return fault("is nowhere");
      if (!(std::abs(surfel.normal.norm() - 1) <= kUnitTolerance)) {
        return fault("has a normal that is not of unit length");
      }
      if (!(surfel.radius_m > 0) || static_cast<double>(surfel.radius_m) > 1.0001 * most_radius_m) {
        return fault(fmt::format("has a radius of {} m", surfel.radius_m));
      }
      if (surfel.confidence < 1) return fault("was never seen");
      if (surfel.born < 1 || surfel.born > frames_) return fault("is of a frame that is to come");
      if (!surfel.is_stable() && frames_ - surfel.born >= kFramesToBeStable) {
        return fault("should have become stable or gone");
      }
    }
  }
  return std::nullopt;
}

const std::vector<Surfel>* SurfelMap::SurfelsOf(InstanceId id) const {
  const auto object = objects_.find(id);
  return object == objects_.end() ? nullptr : &object->second.surfels;
}

}  // namespace tsdfpp
