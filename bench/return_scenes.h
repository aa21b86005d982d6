// Scenes in which an object goes out of sight and comes back, or is pushed, drawn by a seed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "sim/config/scene_config.h"

namespace tsdfpp {

enum class ReturnKind {
  kCarried,   // one object is carried out of the picture, and put down elsewhere, turned
  kTwo,       // so are two, which come back together
  kHidden,    // a screen passes before an object, and hides it for half a second and more
  kMoved,     // and the object is elsewhere, turned a little, when the screen has gone
  kReplaced,  // one is carried out and does not come back; another one comes
  kPushed,    // one slides over the table and turns
  kStill,     // nothing moves but the camera
};
inline constexpr std::string_view ReturnKindName(ReturnKind kind) {
  constexpr std::string_view kNames[] = {"carried",  "two carried", "hidden", "moved",
                                         "replaced", "pushed",      "still"};
  return kNames[static_cast<int>(kind)];
}

struct ReturnScene {
  ReturnKind kind{};
  SceneConfig scene{};
  int last_before = 0;                  // the last frame before anything moves
  std::vector<InstanceId> returning{};  // the objects that go out of sight and come back
  InstanceId pushed = kNoInstance;
  double speed_m = 0;  // of the one that is pushed, a second
};

// Of frames of 320 x 240 pixels, at 30 a second: toys of the catalogue, each once at most, some of
// them painted. Two stay where they are; three of kPushed, and all four of kStill.
ReturnScene DrawReturnScene(ReturnKind kind, std::uint64_t seed);

}  // namespace tsdfpp
