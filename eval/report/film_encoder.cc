#include "eval/report/film_encoder.h"

#include "core/late_library.h"

namespace tsdfpp {

Expected<std::unique_ptr<FilmEncoder>> NewFilmEncoder() {
  TSDFPP_ASSIGN(void* const function,
                LateFunction("libtsdfpp_film_encoder.so", "TsdfppNewFilmEncoder"));
  return std::unique_ptr<FilmEncoder>(reinterpret_cast<FilmEncoder* (*)()>(function)());
}

}  // namespace tsdfpp
