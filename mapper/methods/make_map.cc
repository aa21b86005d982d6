#include <cstdlib>

#include "mapper/map_representation.h"
#include "mapper/methods/anchored_map.h"
#include "mapper/methods/literal_map.h"
#include "mapper/methods/single_field_map.h"
#include "mapper/methods/surfel_map.h"
#include "mapper/methods/tsdfpp_map.h"
#include "mapper/methods/volumes_map.h"

namespace tsdfpp {

std::unique_ptr<MapRepresentation> MakeMap(Method method, const MapConfig& config) {
  if (!config.Validate()) std::abort();
  const int layers = LayersOf(method, config);
  switch (method) {
    case Method::kTsdf:
      return std::make_unique<SingleFieldMap>(config, FieldRule::kOverwrite);
    case Method::kTsdfMin:
      return std::make_unique<SingleFieldMap>(config, FieldRule::kKeepNearer);
    case Method::kTsdfGuarded:
      return std::make_unique<SingleFieldMap>(config, FieldRule::kGuarded);
    case Method::kTsdfStatic:
      return std::make_unique<SingleFieldMap>(config, FieldRule::kStatic);
    case Method::kTsdfpp:
      return std::make_unique<TsdfppMap>(config, layers);
    case Method::kTsdfppLiteral:
      return std::make_unique<LiteralMap>(config);
    case Method::kTsdfppAnchored:
      return std::make_unique<AnchoredMap>(config, layers);
    case Method::kVolumes:
      return std::make_unique<VolumesMap>(config);
    case Method::kSurfels:
      return std::make_unique<SurfelMap>(config);
  }
  std::abort();
}

}  // namespace tsdfpp
