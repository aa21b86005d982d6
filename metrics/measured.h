// A number that may be undefined: never 0 in its place (docs/sources.md, "Undefined values").
#pragma once

#include <optional>
#include <string>
#include <utility>

namespace tsdfpp {

struct Measured {
  std::optional<double> value;
  std::string why_not;  // one clause, only where there is no value

  static Measured Of(double number) { return {number, {}}; }
  static Measured Undefined(std::string reason) { return {std::nullopt, std::move(reason)}; }
};

}  // namespace tsdfpp
