// SPDX-License-Identifier: Apache-2.0
// Film optics of one view, and the launch of one step of them over held images; read by GLSL and C++ (scalar layout).
#ifndef KUAFU_FILM_RECORD_H
#define KUAFU_FILM_RECORD_H

#include "shared/wave.h"

#ifdef __cplusplus
namespace kuafu {
#endif

/// Field position: (fx, fy) is -1..1 from the first pixel's centre to the last one's, so (fx^2 + fy^2) / 2 is 1 in the corners.
struct FilmRecord {
  float vignetting_exponent, vignetting_a1, vignetting_a2, vignetting_a3;
  float fx, fy, cx, cy, skew;  // of the camera: x = (u - cx - skew y) / fx, y = (v - cy) / fy
  float distortion[8];  // k1 k2 p1 p2 k3 k4 k5 k6, where `distorts`
  uint distorts;
  float psf_corner_sigma_px;
  uint psf_radius, psf_kernels;  // taps beside the middle one; first word of the kernels. Radius 0: no blur
  float psf_kernels_per_variance;  // how many per px^2 from the middle's variance to the corners'; 0: one alone
  float defocus_px_m, defocus_inverse_focus;  // f_px times the lens' radius, 1 / m; circle radius = their product with |1/z - 1/focus|
  float veiling_glare_fraction;
  float firefly_factor;  // 0: none
};
KUAFU_ARRAY(FilmArray, FilmRecord, 4)

KUAFU_CONST film_vignetting = 0u;     // per pixel, in place
KUAFU_CONST film_circle_rows = 1u;    // per row: its largest circle of confusion
KUAFU_CONST film_defocus = 2u;        // per pixel
KUAFU_CONST film_psf_columns = 3u;    // per pixel: along the row
KUAFU_CONST film_psf_rows = 4u;       // per pixel: along the column
KUAFU_CONST film_row_sums = 5u;       // per row and channel
KUAFU_CONST film_view_means = 6u;     // per view and channel
KUAFU_CONST film_veiling_glare = 7u;  // per pixel, in place
KUAFU_CONST film_copy = 8u;           // per pixel
KUAFU_CONST film_fireflies = 9u;      // per pixel: takes the projector's direct light off, and looks at the pixels beside
KUAFU_CONST film_firefly_pairs = 10u; // per pixel: looks at those two away, and puts the direct light back

KUAFU_CONST film_most_radius_px = 32u;  // of a circle of confusion

/// Images are packed [view][row][column][channel].
struct FilmPush {
  FloatArray from, to;
  FloatArray depth;  // [view][row][column], metres, 0 = nothing hit
  FloatArray rows;   // one word per view, row and channel; then one per view and channel
  FilmArray films;   // one per view
  FloatArray kernels;
  FloatArray direct;  // the projector's direct light, for fireflies
  uint step, count;  // film_*; invocations
  uint width, height, channels, view_count;
};

#ifdef __cplusplus
static_assert(sizeof(FilmRecord) == 104);
static_assert(sizeof(FilmPush) == 80);
}  // namespace kuafu
#endif
#endif
