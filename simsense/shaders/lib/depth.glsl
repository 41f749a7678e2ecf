// SPDX-License-Identifier: Apache-2.0
// Disparity to depth and the formats of both, as in cpu/depth/depth.cpp and cpu/frame.h.
#ifndef SIMSENSE_DEPTH_GLSL
#define SIMSENSE_DEPTH_GLSL
#include "lib/exact_ratio.glsl"
#include "lib/image.glsl"
#include "shared/depth_push.h"

const uint infinity = 0x7f800000u;  // bits of the float

/// z of a disparity, 0 where there is none.
float depth_of(DepthParameters p, float disparity) {
  float parallax = disparity + p.offset_px;
  if (!(disparity > p.invalid && parallax > 0.0f)) return 0.0f;
  precise float z = exact_quotient(p.focal_baseline, parallax);
  return floatBitsToUint(z) < infinity ? z : 0.0f;
}

float keep(DepthParameters p, float z) { return z >= p.min_m && z < p.max_m ? z : 0.0f; }

/// A cell of the z-buffer of pair n; column and row count from the margin's corner.
uint cell_at(DepthParameters p, uint n, int column, int row) {
  uint pitch = p.rgb_width + 2u * SPLAT_MARGIN, rows = p.rgb_height + 2u * SPLAT_MARGIN;
  return (n * rows + uint(row)) * pitch + uint(column);
}

/// Metres, or millimetres where the format is of integers; beyond their range there is no measurement.
void store_depth(ImageRef image, uint element, float z) {
  precise float mm = roundEven(z * 1000.0f);
  if (image.format == FORMAT_F32) store_f32(image, element, z);
  if (image.format == FORMAT_U16) U16Array(image.address).at[element] = uint16_t(mm <= 65535.0f ? uint(mm) : 0u);
  if (image.format == FORMAT_I16) I16Array(image.address).at[element] = int16_t(mm <= 32767.0f ? int(mm) : 0);
}

/// Pixels, or sixteenths of pixels.
void store_disparity(ImageRef image, uint element, float disparity) {
  if (image.format == FORMAT_F32) store_f32(image, element, disparity);
  if (image.format == FORMAT_I16) I16Array(image.address).at[element] = int16_t(int(roundEven(disparity * 16.0f)));
}

void store_point(DepthParameters p, ImageRef image, uint element, uint x, uint y, uint pitch, float z) {
  bool each = p.rays_per_pixel != 0u;
  float ray_x = p.ray_x.at[each ? y * pitch + x : x], ray_y = p.ray_y.at[each ? y * pitch + x : y];
  store_f32(image, element, z * ray_x);
  store_f32(image, element + uint(image.component_stride), z * ray_y);
  store_f32(image, element + 2u * uint(image.component_stride), z);
}
#endif
