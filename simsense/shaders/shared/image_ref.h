// SPDX-License-Identifier: Apache-2.0
// A batch of strided images in device memory, read by GLSL and C++ (scalar layout).
#ifndef SIMSENSE_IMAGE_REF_H
#define SIMSENSE_IMAGE_REF_H

// KS_FORMAT_* by number: shaders cannot read ks/image.h.
#define FORMAT_U8 1u
#define FORMAT_U16 2u
#define FORMAT_I16 3u
#define FORMAT_F32 6u

#ifdef __cplusplus
#include <cstdint>

#include "ks/image.h"

namespace simsense {
using uint = uint32_t;
using BytesAddress = uint64_t;
#else
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_8bit_storage : require
layout(buffer_reference, scalar, buffer_reference_align = 1) buffer BytesAddress { uint8_t at[]; };
#endif

/// Element (n, y, x, c) is number first + n * batch_stride + y * row_stride + x * pixel_stride + c * component_stride from the address on:
/// the lowest address of all elements, so that negative strides wrap to a positive number.
struct ImageRef {
  BytesAddress address;
  uint format;  // KS_FORMAT_*; 0 = no such image
  uint first;
  int batch_stride, row_stride, pixel_stride, component_stride;  // elements
};

#ifdef __cplusplus
static_assert(sizeof(ImageRef) == 32);
static_assert(FORMAT_U8 == KS_FORMAT_U8 && FORMAT_U16 == KS_FORMAT_U16 && FORMAT_I16 == KS_FORMAT_I16 && FORMAT_F32 == KS_FORMAT_F32);
}  // namespace simsense
#endif
#endif
