/* kuafu: the participating medium. Included by kuafu.h, whose conventions hold. */
#ifndef KUAFU_MEDIUM_H
#define KUAFU_MEDIUM_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "ks/header.h"

#define KUAFU_TYPE_MEDIUM_DESC 0x1010u

/* A homogeneous participating medium (fog, smoke, dusty air): it fills its box outside of bodies, which are closed surfaces that transmit. Light that only got
 * dimmed on its ways stays in its light group; projector light that was scattered is projector indirect. A scattering counts as a bounce. Light from infinitely
 * far (environment, directional lights) is dimmed on its way through the whole box: through an endless medium none arrives. */
typedef struct kuafu_medium_desc {
  ks_header header;
  float extinction_per_m[3];   /* visible band: radiance falls by e after 1/extinction metres */
  float ir_extinction_per_m;   /* NAN = red */
  float albedo[3];             /* 0..1, share of the extinction that is scattering; 0 = absorption alone, which is exact and costs least */
  float ir_albedo;             /* NAN = red */
  float phase_g;               /* mean cosine of scattering (Henyey and Greenstein), in (-1, 1); 0 = even, > 0 forward */
  uint32_t reserved;
  double bounds_min_m[3], bounds_max_m[3]; /* world; -inf and +inf by default */
} kuafu_medium_desc;
static inline kuafu_medium_desc kuafu_medium_desc_init(void) {
  kuafu_medium_desc m;
  int i;
  memset(&m, 0, sizeof m);
  m.header = ks_header_make(KUAFU_TYPE_MEDIUM_DESC, (uint32_t)sizeof m);
  m.ir_extinction_per_m = m.ir_albedo = NAN;
  for (i = 0; i < 3; ++i) {
    m.bounds_min_m[i] = -INFINITY;
    m.bounds_max_m[i] = INFINITY;
  }
  return m;
}

#endif
