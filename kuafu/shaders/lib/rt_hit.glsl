// SPDX-License-Identifier: Apache-2.0
// The payload of rays in the ray tracing pipeline.
#ifndef KUAFU_RT_HIT_GLSL
#define KUAFU_RT_HIT_GLSL
#extension GL_EXT_ray_tracing : require

struct RtHit {
  float t;
  vec2 uv;        // barycentrics of vertices 1 and 2
  uint primitive; // before there is a hit: what kind of ray it is (lib/cutout.glsl)
  uint instance;  // shared/ray_queue.h: miss where there is none
};

#endif
