#include "api/film_desc.h"

#include <cmath>

#include "device/struct_read.h"

namespace kuafu {
namespace {

constexpr double most_sigma_px = 32.0, most_exponent = 64.0;

void check_range(const std::string& view, const char* field, double value, double most) {
  if (!(value >= 0.0 && value <= most))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.film.%s is %g, it must be 0..%g", view.c_str(), field, value, most);
}

}  // namespace

Film read_film(const kuafu_film_desc* desc, const std::string& view) {
  if (desc == nullptr) return {};
  const kuafu_film_desc d = ks::read_struct(desc, KUAFU_TYPE_FILM_DESC, "film desc");
  check_range(view, "vignetting_exponent", d.vignetting_exponent, most_exponent);
  for (const double a : d.vignetting_polynomial)
    if (!(std::abs(a) <= 1e6))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.film.vignetting_polynomial has %g, at most 1e6 is possible", view.c_str(), a);
  check_range(view, "defocus_lens_radius_m", d.defocus_lens_radius_m, 1e3);
  if (d.defocus_lens_radius_m > 0.0 && !(d.defocus_focus_m > 0.0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.film.defocus_focus_m is %g, it must be > 0 where there is a lens", view.c_str(),
             d.defocus_focus_m);
  check_range(view, "psf_sigma_px", d.psf_sigma_px, most_sigma_px);
  check_range(view, "psf_corner_sigma_px", d.psf_corner_sigma_px, most_sigma_px);
  check_range(view, "veiling_glare_fraction", d.veiling_glare_fraction, 1.0);
  return {.vignetting_exponent = d.vignetting_exponent,
          .vignetting_polynomial = {d.vignetting_polynomial[0], d.vignetting_polynomial[1], d.vignetting_polynomial[2]},
          .psf_sigma_px = d.psf_sigma_px,
          .psf_corner_sigma_px = d.psf_corner_sigma_px,
          .defocus_lens_radius_m = d.defocus_lens_radius_m,
          .defocus_focus_m = d.defocus_focus_m,
          .veiling_glare_fraction = d.veiling_glare_fraction};
}

}  // namespace kuafu
