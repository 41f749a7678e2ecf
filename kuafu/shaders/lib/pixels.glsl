// SPDX-License-Identifier: Apache-2.0
// From the position in a wave to view, row and column.
#ifndef KUAFU_PIXELS_GLSL
#define KUAFU_PIXELS_GLSL
#include "lib/language.glsl"
#include "shared/wave.h"

struct Pixel {
  uint view, row, column;
};

/// Blocks as tiles of 8 x 4 pixels, row by row, pixels inside in the order of Morton: neighbours in a wave see nearly the same, whatever their samples.
Pixel tile_pixel(IN(WaveRange) range, uint p) {
  uint columns = range.width / 8u, block = p / pixel_block, lane = p % pixel_block;
  uint x = (lane & 1u) | ((lane >> 1) & 2u) | ((lane >> 2) & 4u), y = ((lane >> 1) & 1u) | ((lane >> 2) & 2u);
  uint row = block / columns * 4u + y;
  return Pixel(row / range.height, row % range.height, block % columns * 8u + x);
}

// Blocks are permuted so that a device that splits work statically gives each thread a fair mix of the image; others want neighbours close together.
Pixel wave_pixel(IN(WaveRange) range, uint local_pixel) {
  uint p = range.first_pixel + local_pixel;
  uint block = p / pixel_block;
  if (range.block_stride == 0u && range.width % 8u == 0u && range.height % 4u == 0u) return tile_pixel(range, p);
  if (range.block_stride > 0u && block < range.block_count) p = (block * range.block_stride % range.block_count) * pixel_block + p % pixel_block;
  uint row = p / range.width;
  return Pixel(row / range.height, row % range.height, p % range.width);
}

/// Of an index into images, [view][row][column].
Pixel image_pixel(IN(WaveRange) range, uint index) {
  uint row = index / range.width;
  return Pixel(row / range.height, row % range.height, index % range.width);
}

uint output_element(IN(OutputRecord) record, Pixel pixel, uint channels) {
  return uint(record.first + int(pixel.view) * record.view_stride + int(pixel.row) * record.row_stride + int(pixel.column * channels));
}
#endif
