/* kuafu: what a camera's optics do to the image. Included by kuafu.h, whose conventions hold. */
#ifndef KUAFU_FILM_H
#define KUAFU_FILM_H

#include <stdint.h>
#include <string.h>

#include "ks/header.h"

#define KUAFU_TYPE_FILM_DESC 0x100du

/* What a camera's optics do to the light before it reaches the imager, as steps on linear images, in the order of the fields: vignetting, defocus, point
 * spread, veiling glare. Every image of light gets them (radiance and the groups: their sum stays the image), AOVs do not. Neutral as initialised: an image
 * then keeps its bits. (fx, fy) is the position in the field, -1..1 from the first pixel to the last, so r^2 = (fx^2 + fy^2) / 2 is 1 in the corners.
 * Light beyond the image's border is taken to be that of the nearest pixel. */
typedef struct kuafu_film_desc {
  ks_header header;
  double vignetting_exponent;      /* times cos^n of the angle between pixel and optical axis, n >= 0; 4 is a thin lens' */
  double vignetting_polynomial[3]; /* times 1 + a1 r^2 + a2 r^4 + a3 r^6, at least 0 */
  /* A point becomes a disc of radius f_px defocus_lens_radius_m |1/z - 1/defocus_focus_m| pixels, at most 32, z being its pixel's depth and f_px the mean of
   * k[0] and k[4]. Light from behind a pixel's surface spreads over it no farther than that surface blurs itself; what a near edge hides is filled in from
   * beside it. kuafu_camera_desc's lens traces the same thing at the cost of samples. */
  double defocus_lens_radius_m;    /* of the aperture; 0 = sharp everywhere */
  double defocus_focus_m;          /* distance that is sharp; INFINITY is possible */
  /* Gaussian of variance psf_sigma_px^2 + (psf_corner_sigma_px r^2)^2 at the point it comes from; its kernel on the pixels has exactly that variance, and
   * the sum 1. Each at most 32 px. */
  double psf_sigma_px;
  double psf_corner_sigma_px;
  double veiling_glare_fraction;   /* 0..1 of the light is spread evenly over the image (ISO 9358) */
} kuafu_film_desc;
static inline kuafu_film_desc kuafu_film_desc_init(void) {
  kuafu_film_desc f;
  memset(&f, 0, sizeof f);
  f.header = ks_header_make(KUAFU_TYPE_FILM_DESC, (uint32_t)sizeof f);
  f.defocus_focus_m = 1.0;
  return f;
}

#endif
