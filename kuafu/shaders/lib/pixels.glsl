// From the position in a wave to view, row and column.
#ifndef KUAFU_PIXELS_GLSL
#define KUAFU_PIXELS_GLSL
#include "lib/language.glsl"
#include "shared/wave.h"

struct Pixel {
  uint view, row, column;
};

// Blocks are permuted so that a device that splits work statically gives each thread a fair mix of the image.
Pixel wave_pixel(IN(WaveRange) range, uint local_pixel) {
  uint p = range.first_pixel + local_pixel;
  uint block = p / pixel_block;
  if (block < range.block_count) p = (block * range.block_stride % range.block_count) * pixel_block + p % pixel_block;
  uint row = p / range.width;
  return Pixel(row / range.height, row % range.height, p % range.width);
}

uint output_element(IN(OutputRecord) record, Pixel pixel, uint channels) {
  return uint(record.first + int(pixel.view) * record.view_stride + int(pixel.row) * record.row_stride + int(pixel.column * channels));
}
#endif
