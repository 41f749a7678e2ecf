/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_MEDIUM_H
#define KUAFU_MEDIUM_H
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_TYPE_MEDIUM_DESC 0x1010u
typedef struct kuafu_medium_desc {
  ks_header header;
  float extinction_per_m[3];
  float ir_extinction_per_m;
  float albedo[3];
  float ir_albedo;
  float phase_g;
  float housing_m;
  double bounds_min_m[3];
  double bounds_max_m[3];
} kuafu_medium_desc;
static inline kuafu_medium_desc kuafu_medium_desc_init(void) {
  kuafu_medium_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_MEDIUM_DESC, KS_CAST(uint32_t, sizeof s));
  s.ir_extinction_per_m = NAN;
  s.ir_albedo = NAN;
  s.bounds_min_m[0] = -INFINITY;
  s.bounds_min_m[1] = -INFINITY;
  s.bounds_min_m[2] = -INFINITY;
  s.bounds_max_m[0] = INFINITY;
  s.bounds_max_m[1] = INFINITY;
  s.bounds_max_m[2] = INFINITY;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
