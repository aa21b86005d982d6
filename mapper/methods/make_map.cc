#include <cstdlib>

#include "mapper/map_representation.h"
#include "mapper/methods/anchored_map.h"
#include "mapper/methods/literal_map.h"
#include "mapper/methods/single_field_map.h"
#include "mapper/methods/surfel_map.h"
#include "mapper/methods/tsdfpp_map.h"
#include "mapper/methods/volumes_map.h"

namespace tsdfpp {

namespace {

template <FieldRule rule>
std::unique_ptr<MapRepresentation> MakeField(const MapConfig& config, int /*layers*/) {
  return std::make_unique<SingleFieldMap>(config, rule);
}

template <typename Map>
std::unique_ptr<MapRepresentation> MakeFixed(const MapConfig& config, int /*layers*/) {
  return std::make_unique<Map>(config);
}

template <typename Map>
std::unique_ptr<MapRepresentation> MakeLayered(const MapConfig& config, int layers) {
  return std::make_unique<Map>(config, layers);
}

struct Maker {
  Method method;
  std::unique_ptr<MapRepresentation> (*make)(const MapConfig& config, int layers);
};

// A row a method, as in mapper/method_info.cc, which readers of names have without the maps.
constexpr Maker kMakers[] = {
    {Method::kTsdf, MakeField<FieldRule::kOverwrite>},
    {Method::kTsdfMin, MakeField<FieldRule::kKeepNearer>},
    {Method::kTsdfGuarded, MakeField<FieldRule::kGuarded>},
    {Method::kTsdfStatic, MakeField<FieldRule::kStatic>},
    {Method::kTsdfpp, MakeLayered<TsdfppMap>},
    {Method::kTsdfppLiteral, MakeFixed<LiteralMap>},
    {Method::kTsdfppAnchored, MakeLayered<AnchoredMap>},
    {Method::kVolumes, MakeFixed<VolumesMap>},
    {Method::kSurfels, MakeFixed<SurfelMap>},
};

}  // namespace

std::unique_ptr<MapRepresentation> MakeMap(Method method, const MapConfig& config) {
  if (!config.Validate()) std::abort();
  for (const Maker& maker : kMakers) {
    if (maker.method == method) return maker.make(config, LayersOf(method, config));
  }
  std::abort();
}

}  // namespace tsdfpp
