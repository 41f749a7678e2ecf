// Stage `film` compiled as C++. Thread rule: any thread; ranges are independent.
#pragma once

#include "shared/film_record.h"

namespace kuafu::host {

void film(const FilmPush& push, uint32_t first, uint32_t end);

}  // namespace kuafu::host
