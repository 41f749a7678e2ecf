// SPDX-License-Identifier: Apache-2.0
// What the rectification stages share, read by GLSL and C++ (scalar layout).
#ifndef SIMSENSE_REMAP_PUSH_H
#define SIMSENSE_REMAP_PUSH_H
#include "shared/image_ref.h"

#ifdef __cplusplus
namespace simsense {
using RemapFloats = uint64_t;
#else
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer RemapFloats { float at[]; };
#endif

struct RemapPush {
  ImageRef source, target, copy;  // copy: for the caller; either may be absent
  RemapFloats x, y;               // [height][width] source coordinates of each rectified pixel
  uint width, height;
  uint nearest;  // nonzero: the nearest pixel, the edge repeats; else bilinear, 0 outside
};

struct CopyPush {
  ImageRef source, target;
  uint width, height;
  uint extra_bits;  // of the source's counts, which an image of 8 bits lacks
};

#ifdef __cplusplus
static_assert(sizeof(RemapPush) == 128);
}  // namespace simsense
#endif
#endif
