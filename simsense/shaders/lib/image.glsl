// SPDX-License-Identifier: Apache-2.0
// Elements of an ImageRef in whatever format it has.
#ifndef SIMSENSE_IMAGE_GLSL
#define SIMSENSE_IMAGE_GLSL
#extension GL_EXT_shader_16bit_storage : require
#include "shared/image_ref.h"

layout(buffer_reference, scalar, buffer_reference_align = 2) buffer U16Array { uint16_t at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 2) buffer I16Array { int16_t at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer F32Array { float at[]; };

uint element_of(ImageRef image, uint n, uint x, uint y) {
  return image.first + n * uint(image.batch_stride) + y * uint(image.row_stride) + x * uint(image.pixel_stride);
}

float load_element(ImageRef image, uint element) {
  if (image.format == FORMAT_U8) return float(uint(image.address.at[element]));
  if (image.format == FORMAT_U16) return float(uint(U16Array(image.address).at[element]));
  return F32Array(image.address).at[element];
}

/// Counts into 8 or 16 bit.
void store_counts(ImageRef image, uint element, uint counts) {
  if (image.format == FORMAT_U8) image.address.at[element] = uint8_t(counts);
  if (image.format == FORMAT_U16) U16Array(image.address).at[element] = uint16_t(counts);
}

/// A value of the same format, or counts of another width.
void store_element(ImageRef image, uint element, float value) {
  if (image.format == FORMAT_F32) {
    F32Array(image.address).at[element] = value;
  } else {
    store_counts(image, element, uint(value));
  }
}

void store_f32(ImageRef image, uint element, float value) { F32Array(image.address).at[element] = value; }
#endif
