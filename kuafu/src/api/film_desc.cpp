// SPDX-License-Identifier: Apache-2.0
#include "api/film_desc.h"

#include "api/fields.h"
#include "api/struct_table.h"
#include "device/struct_read.h"

namespace kuafu {

Film read_film(const kuafu_film_desc* desc, const std::string& view) {
  Film film;
  if (desc == nullptr) return film;
  copy_fields(ks::read_struct(desc, KUAFU_TYPE_FILM_DESC, "film desc"), film);
  check_fields(film, view + ".film.");
  if (film.defocuses() && !(film.defocus_focus_m > 0.0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.film.defocus_focus_m is %g, it must be > 0 where there is a lens", view.c_str(),
             film.defocus_focus_m);
  return film;
}

}  // namespace kuafu
