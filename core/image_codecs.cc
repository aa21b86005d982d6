#include "core/image_codecs.h"

#include "core/late_library.h"

namespace tsdfpp {

Expected<ImageCodecs> LoadImageCodecs() {
  TSDFPP_ASSIGN(void* const function,
                LateFunction("libtsdfpp_image_codecs.so", "TsdfppImageCodecs"));
  ImageCodecs codecs{};
  reinterpret_cast<void (*)(ImageCodecs*)>(function)(&codecs);
  return codecs;
}

}  // namespace tsdfpp
