// SPDX-License-Identifier: Apache-2.0
// The words of a ray queue behind a device address, and its layout.
#ifndef KUAFU_QUEUE_WORDS_GLSL
#define KUAFU_QUEUE_WORDS_GLSL
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

#include "shared/arrays.h"  // its extensions, before any code
#include "shared/ray_queue.h"

layout(constant_id = 1) const uint queue_layout = queue_layout_planes;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer QueueWords { uint word[]; };

#endif
