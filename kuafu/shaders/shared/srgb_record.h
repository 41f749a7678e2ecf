// SPDX-License-Identifier: Apache-2.0
// Held radiance on its way to bytes of sRGB, and the exposure that it gets; read by GLSL and C++ (scalar layout).
// Light is told apart by its bits, which order positive floats: the same bytes come out on every device.
#ifndef KUAFU_SRGB_RECORD_H
#define KUAFU_SRGB_RECORD_H

#include "shared/wave.h"

#ifdef __cplusplus
namespace kuafu {
#endif

// The curve: an entry for each value of the upper 16 bits of a float from 2^-13, which is byte 0, to 1. An entry holds the byte of the
// smallest such float, and from which lower 16 bits on it is the next byte; at most one byte begins within an entry.
KUAFU_CONST srgb_first_entry = 0x3900u;
KUAFU_CONST srgb_last_entry = 0x3f80u;
KUAFU_CONST srgb_byte_shift = 17u;
KUAFU_CONST srgb_start_mask = 0x1ffffu;
KUAFU_CONST srgb_no_start = 0x10000u;  // the entry is one byte's alone

// The exposure: which class of light, the upper 16 bits of a float, the median lit pixel's green is in.
KUAFU_CONST light_smallest = 0x00800000u;  // a light below is none: devices may take it for 0
KUAFU_CONST light_infinite = 0x7f800000u;
KUAFU_CONST light_classes = 0x7f80u;
KUAFU_CONST light_decades = 0xffu;         // of 128 classes each, one exponent
KUAFU_CONST light_class_shift = 16u;
KUAFU_CONST light_decade_shift = 7u;       // from a class
KUAFU_CONST light_stride = 2u;             // every so many pixels are looked at, in x and y

// Words of SrgbPush.lights.
KUAFU_CONST lights_exposure = 0u;  // what was chosen, a float
KUAFU_CONST lights_decades = 1u;   // how many pixels, by decade
KUAFU_CONST lights_classes = 1u + light_decades;  // and by class
KUAFU_CONST lights_words = lights_classes + light_classes;

KUAFU_CONST srgb_count = 0u;   // per pixel that is looked at
KUAFU_CONST srgb_choose = 1u;  // once
KUAFU_CONST srgb_encode = 2u;  // per pixel

struct SrgbPush {
  UintArray from;  // radiance, packed [view][row][column][3]
  OutputRecord to;
  UintArray curve;
  FloatArray exposures;  // by class of the median
  UintArray lights;
  uint step, count;  // srgb_*; invocations
  uint width, height;
  float exposure;  // of the caller's; 0: the one that was chosen
  uint reserved;
};

#ifdef __cplusplus
static_assert(sizeof(SrgbPush) == 88);
}  // namespace kuafu
#endif
#endif
