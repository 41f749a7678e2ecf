// SPDX-License-Identifier: Apache-2.0
// Push constants of the ray tracing pipeline: of its ray generation shaders, and of the one that is asked about cutouts.
#ifndef KUAFU_RT_PUSH_GLSL
#define KUAFU_RT_PUSH_GLSL
#include "lib/queue_words.glsl"
#include "shared/wave.h"

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer TopLevels { uvec2 address[]; };

layout(push_constant, scalar) uniform Push {
  QueueWords words;
  QueueWords environments;  // null unless has_environments
  QueueWords count;
  TopLevels top_levels;     // device address of each environment's acceleration structure; 0 = it is empty
  SceneReference scene;     // null where everything is there
  uint capacity;
  uint environment_count;
  uint has_environments;
} push;
#endif
