// SPDX-License-Identifier: Apache-2.0
// Layout of the ray queues, read by GLSL and C++. A queue is an array of 32-bit words; ray i's field f stands at ray_word(i, f, ...).
// Two layouts: packets of 8 in place as Embree's RTCRayHit8 / RTCRay8 expect them (CPU devices), or one plane per field (GPUs: coalesced).
// Field numbers are Embree 3's member order; planes leave out what Embree alone asks for.
#ifndef KUAFU_RAY_QUEUE_H
#define KUAFU_RAY_QUEUE_H

#ifdef __cplusplus
#include <cstdint>
namespace kuafu {
using uint = uint32_t;
#define KUAFU_CONST inline constexpr uint
#define KUAFU_FN inline constexpr uint
#else
#define KUAFU_CONST const uint
#define KUAFU_FN uint
#endif

KUAFU_CONST queue_layout_planes = 0u;
KUAFU_CONST queue_layout_packets = 1u;

KUAFU_CONST ray_origin = 0u;   // 3 words
KUAFU_CONST ray_t_near = 3u;
KUAFU_CONST ray_direction = 4u;  // 3 words, unit length
KUAFU_CONST ray_time = 7u;     // seconds from mid-exposure of the middle line; 0 where nothing moves
KUAFU_CONST ray_t_far = 8u;    // in: limit; out: hit distance (closest), or < 0 = occluded (occluded)
KUAFU_CONST ray_mask = 9u;     // 0xffffffff; for Embree, in packets alone, as ray_flags
KUAFU_CONST ray_id = 10u;      // path slot; of shadow rays: shared/wave.h
KUAFU_CONST ray_flags = 11u;   // 0
KUAFU_CONST occlusion_words = 12u;  // an occlusion ray ends here; words 12 to 14 are a normal that Embree alone writes
KUAFU_CONST hit_u = 15u;       // barycentric of vertex 1
KUAFU_CONST hit_v = 16u;       // barycentric of vertex 2
KUAFU_CONST hit_primitive = 17u;  // triangle index in its mesh
KUAFU_CONST hit_geometry = 18u;   // in: miss; out: anything else = hit
KUAFU_CONST hit_instance = 19u;   // index into the tracer's instance records, which are the scene's live instances in id order
KUAFU_CONST closest_words = 20u;

KUAFU_CONST miss = 0xffffffffu;

/// Of a field that Embree is not the only one to ask for.
KUAFU_FN ray_plane(uint field) { return field < ray_id ? field : field < hit_u ? field - 1u : field - 5u; }

KUAFU_FN ray_word(uint i, uint field, uint words, uint layout_kind, uint capacity) {
  return layout_kind == queue_layout_packets ? ((i >> 3) * words + field) * 8u + (i & 7u) : ray_plane(field) * capacity + i;
}

/// What a queue holds of each ray; words: closest_words or occlusion_words.
KUAFU_FN queue_words_per_ray(uint words, uint layout_kind) {
  return layout_kind == queue_layout_packets ? words : ray_plane(words == occlusion_words ? ray_id : hit_instance) + 1u;
}

#ifdef __cplusplus
}  // namespace kuafu
#endif
#endif
