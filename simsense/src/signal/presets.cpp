// SPDX-License-Identifier: Apache-2.0
#include "signal/imager.h"

#include <cstring>

#include "device/error.h"

namespace simsense {
namespace {

simsense_signal gamma_and_gauss(float shape, float scale, float mu_dn, float sigma_dn) {
  simsense_signal s = simsense_signal_init();
  s.speckle_shape = shape;
  s.speckle_scale = scale;
  s.black_level_dn = mu_dn;
  s.adc_noise_dn = sigma_dn;
  return s;
}

simsense_signal paper_d415() { return gamma_and_gauss(3.98f, 0.254f, -0.231f, 0.83f); }

simsense_signal sapien() { return gamma_and_gauss(1333.33f, 1 / 1333.33f, 0, 0.25f); }

simsense_signal d435() {
  constexpr float dn_per_e = 0.00497f;
  simsense_signal s = simsense_signal_init();
  s.responsivity_e = 1 / dn_per_e;  // input in counts
  s.conversion_gain_dn_per_e = dn_per_e;
  s.shot_noise = 1;
  s.adc_noise_dn = 0.1f;
  return s;
}

struct Preset {
  const char* name;
  simsense_signal (*make)();
};
constexpr Preset presets[] = {{"neutral", simsense_signal_init}, {"paper-d415", paper_d415}, {"sapien", sapien}, {"d435", d435}};

}  // namespace

simsense_signal signal_preset(const char* name) {
  for (const Preset& preset : presets)
    if (name && std::strcmp(name, preset.name) == 0) return preset.make();
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "no signal preset '%s' (known: neutral, paper-d415, sapien, d435)", name ? name : "NULL");
}

}  // namespace simsense
