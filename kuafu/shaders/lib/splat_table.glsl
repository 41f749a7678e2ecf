// SPDX-License-Identifier: Apache-2.0
// The table of landed beams (shared/beam_record.h): a hash grid whose cells are about as large as what landed in them, so that each beam stands in few
// of them, and a point asks one cell of each size.
#ifndef KUAFU_SPLAT_TABLE_GLSL
#define KUAFU_SPLAT_TABLE_GLSL
#include "lib/language.glsl"
#include "lib/sequence.glsl"
#include "shared/beam_record.h"

float cells_per_metre(int level) { return uintBitsToFloat(uint(127 - level) << 23u); }

/// From an offset across a landed beam's direction to one on its surface.
vec3 on_surface(IN(Beam) p, vec3 across) {
  float facing = dot(p.direction, p.direction_u), least = 0.1f * length(p.direction_u);
  float slope = abs(facing) < least ? (facing < 0.0f ? -least : least) : facing;
  return across - p.direction * (dot(across, p.direction_u) / slope);
}

/// Along a landed beam's section: half its length.
vec3 section_along(IN(Beam) p) { return p.direction_v / dot(p.direction_v, p.direction_v); }

/// Of the box around a landed beam's section.
vec3 half_width_of(IN(Beam) p) {
  vec3 half_length = section_along(p), along = normalize(p.direction_v), across = cross(p.direction, along);
  vec2 over_width = vec2(dot(p.position_u, across), dot(p.position_v, across));
  float width_squared = 1.0f / dot(over_width, over_width);
  vec3 to_u = half_length * (dot(p.position_u, half_length)) + across * (over_width.x * width_squared);
  vec3 to_v = half_length * (dot(p.position_v, half_length)) + across * (over_width.y * width_squared);
  float off = 1.0f / length(p.direction_u), facing = max(abs(dot(p.direction, p.direction_u)) * off, 0.1f);
  return abs(on_surface(p, to_u)) + abs(on_surface(p, to_v)) + abs(p.direction) * (off / facing);
}

/// Of cells at least as wide as this.
int level_of(float half_width) {
  int above = int((floatBitsToUint(max(half_width, 1e-30f)) >> 23u) & 0xffu) - 126;
  return max(above, splat_least_level);
}

ivec3 cell_of(vec3 p, int level) {
  vec3 c = floor(clamp(p * cells_per_metre(level), vec3(-1e9f), vec3(1e9f)));
  return ivec3(int(c.x), int(c.y), int(c.z));
}

uint bucket_of(IN(SplatTable) table, ivec3 cell, int level, uint light, uint environment) {
  uint h = hash(uint(cell.x) ^ hash(uint(cell.y) ^ hash(uint(cell.z) ^ hash(uint(level) ^ (light << 8u) ^ (environment << 20u)))));
  return h & (table.buckets - 1u);
}

/// Word of the table that holds a bucket's first entry; its count of entries follows.
uint head_word(uint bucket) { return splat_heads + splat_words_per_head * bucket; }

/// Word of the table that holds an entry: a beam's index.
uint entry_word(IN(SplatTable) table, uint entry) { return head_word(table.buckets) + entry; }
#endif
