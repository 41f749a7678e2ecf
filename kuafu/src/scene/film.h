// The optics between the light and the imager, of one camera; neutral as made (kuafu_film_desc). Thread rule: plain data.
#pragma once

namespace kuafu {

struct Film {
  double vignetting_exponent = 0.0, vignetting_polynomial[3] = {};
  double psf_sigma_px = 0.0, psf_corner_sigma_px = 0.0;
  double defocus_lens_radius_m = 0.0, defocus_focus_m = 0.0;  // focus may be infinite
  double veiling_glare_fraction = 0.0;

  [[nodiscard]] bool vignettes() const {
    return vignetting_exponent != 0.0 || vignetting_polynomial[0] != 0.0 || vignetting_polynomial[1] != 0.0 ||
           vignetting_polynomial[2] != 0.0;
  }
  [[nodiscard]] bool spreads() const { return psf_sigma_px > 0.0 || psf_corner_sigma_px > 0.0; }
  [[nodiscard]] bool defocuses() const { return defocus_lens_radius_m > 0.0; }
  [[nodiscard]] bool glares() const { return veiling_glare_fraction > 0.0; }
  [[nodiscard]] bool is_neutral() const { return !vignettes() && !spreads() && !defocuses() && !glares(); }
};

}  // namespace kuafu
