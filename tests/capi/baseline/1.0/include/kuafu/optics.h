/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_OPTICS_H
#define KUAFU_OPTICS_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_TYPE_OPTICS_DESC 0x100du
typedef struct kuafu_optics_desc {
  ks_header header;
  double vignetting_exponent;
  double vignetting_polynomial[3];
  double defocus_lens_radius_m;
  double defocus_focus_m;
  double psf_sigma_px;
  double psf_corner_sigma_px;
  double veiling_glare_fraction;
  double firefly_factor;
} kuafu_optics_desc;
static inline kuafu_optics_desc kuafu_optics_desc_init(void) {
  kuafu_optics_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_OPTICS_DESC, KS_CAST(uint32_t, sizeof s));
  s.defocus_focus_m = 1.0;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
