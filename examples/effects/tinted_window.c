/* SPDX-License-Identifier: Apache-2.0 */
/* A user's effect in C: a tinted window before the rig takes projected light twice and ambient light once.
 * cc -std=c99 -shared -fPIC -I capi/include examples/effects/tinted_window.c -o tinted_window.so */
#include <stddef.h>

#include "ks/effect.h"

static int32_t apply(const ks_effect_view* view, const double* parameters, uint32_t image_count, const double* images, double* out) {
  const size_t pixels = (size_t)view->width * view->height;
  const double once = 1.0 - parameters[0];
  for (uint32_t i = 0; i < image_count; ++i) {
    const double kept = i == 2 ? once : once * once; /* direct, bounced, ambient, flat */
    for (size_t p = 0; p < pixels; ++p) out[i * pixels + p] = kept * images[i * pixels + p];
  }
  return KS_OK;
}

static const ks_effect_parameter parameters[] = {{"absorbed", "1", "share per pass", 0.0, 0.0, 0.9, 0.1}};

const ks_effect* ks_effect_plugin(uint32_t* count) {
  static ks_effect e;
  e = ks_effect_init();
  e.id = "tinted_window";
  e.family = "medium";
  e.summary = "A tinted window takes projected light twice and ambient light once.";
  e.source = "Beer-Lambert";
  e.stage = KS_STAGE_MEDIUM;
  e.parameter_count = 1;
  e.parameters = parameters;
  e.apply = apply;
  *count = 1;
  return &e;
}
