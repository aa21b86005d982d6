#include "mapper/associate/reentry_config.h"

#include <cmath>

namespace tsdfpp {
namespace {

Expected<void> CheckReentry(std::string_view field, double value, double lowest, double highest) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return {};
  return UsageError("re-entry setting '{}' is {}, expected {} to {}", field, value, lowest,
                    highest);
}

}  // namespace

Expected<void> ReentryConfig::Validate() const {
  TSDFPP_RETURN_IF_ERROR(CheckReentry("wait_frames", wait_frames, 0, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("speed_m_s", speed_m_s, 0, 1e6));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("directions", directions, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("turns", turns, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("refined", refined, 1, 1000));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("max_points", max_points, 10, 1'000'000));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("min_on_surface", min_on_surface, 0, 1));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("min_seen", min_seen, 0, 1));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("max_colour", max_colour, 0, 1));
  TSDFPP_RETURN_IF_ERROR(CheckReentry("min_lead", min_lead, 0, 1));
  return {};
}

Expected<ReentryConfig> ReentryConfig::FromToml(const toml::table& table,
                                                const std::string& where) {
  ReentryConfig config;
  TomlReader reader(table, where);
  reader.Get("enabled", config.enabled)
      .Get("wait_frames", config.wait_frames)
      .Get("speed_m_s", config.speed_m_s)
      .Get("directions", config.directions)
      .Get("turns", config.turns)
      .Get("refined", config.refined)
      .Get("max_points", config.max_points)
      .Get("min_on_surface", config.min_on_surface)
      .Get("min_seen", config.min_seen)
      .Get("max_colour", config.max_colour)
      .Get("min_lead", config.min_lead);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (auto valid = config.Validate(); !valid) {
    return UsageError("{}: {}", where, valid.error().message);
  }
  return config;
}

toml::table ReentryConfig::ToToml() const {
  return toml::table{{"enabled", enabled},       {"wait_frames", wait_frames},
                     {"speed_m_s", speed_m_s},   {"directions", directions},
                     {"turns", turns},           {"refined", refined},
                     {"max_points", max_points}, {"min_on_surface", min_on_surface},
                     {"min_seen", min_seen},     {"max_colour", max_colour},
                     {"min_lead", min_lead}};
}

}  // namespace tsdfpp
