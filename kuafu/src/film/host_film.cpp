// SPDX-License-Identifier: Apache-2.0
#include "film/film.h"

#include "frame/host_language.h"

namespace kuafu {
namespace {

#include "lib/distortion.glsl"

struct FilmStage {
  const FilmPush& push;
#include "stage/film.glsl"
};

}  // namespace

void host::film(const FilmPush& push, uint32_t first, uint32_t end) {
  for (FilmStage stage{push}; first < end; ++first) stage.film(first);
}

}  // namespace kuafu
