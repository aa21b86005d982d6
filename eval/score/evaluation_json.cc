// Apart from the evaluation itself: readers of results need this alone.
#include "eval/score/evaluation.h"

namespace tsdfpp {

nlohmann::json ToJson(const Measured& measured) {
  if (measured.value) return *measured.value;
  return {{"value", nullptr}, {"why", measured.why_not}};
}

}  // namespace tsdfpp
