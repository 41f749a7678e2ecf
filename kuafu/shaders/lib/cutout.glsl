// SPDX-License-Identifier: Apache-2.0
// Surfaces that are not everywhere there: what a tracer asks where a ray meets a triangle, so that cameras, paths and shadow rays agree about it.
#ifndef KUAFU_CUTOUT_GLSL
#define KUAFU_CUTOUT_GLSL
#include "shared/wave.h"
#include "lib/sequence.glsl"
#include "lib/texture.glsl"

/// How much of a material is there: 0 or 1 with alpha_mask.
float coverage(IN(SceneAddresses) scene, IN(MaterialRecord) m, IN(TexturePlace) place, float vertex_alpha) {
  if (m.alpha_mode == alpha_opaque) return 1.0f;
  float alpha = m.alpha * vertex_alpha * material_texel(scene, m.alpha_texture, place).a;
  if (m.alpha_mode == alpha_mask) return alpha >= m.alpha_cutoff ? 1.0f : 0.0f;
  return alpha;
}

vec2 uv_between(Vec2Array uvs, uvec3 vertices, vec3 weights) {
  return weights.x * uvs.at[vertices.x] + weights.y * uvs.at[vertices.y] + weights.z * uvs.at[vertices.z];
}

/// Whether a ray that meets this point of a triangle meets anything. Where only a share is there, a hash of the point decides: each ray meets another point,
/// and the same ray always gets the same answer. `kind` (cutout_*) keeps a shadow ray that runs back along a path's ray from repeating its answer.
bool stands_at(IN(SceneAddresses) scene, uint index, uint primitive, float u, float v, uint kind) {
  IN(InstanceRecord) r = scene.instances.at[index];
  uint slot = (r.flags & instance_has_slots) != 0u ? r.slots.at[primitive] : 0u;
  IN(MaterialRecord) m = scene.materials.at[scene.instance_materials.at[r.first_material + min(slot, r.material_count)]];
  if (m.alpha_mode == alpha_opaque) return true;
  uvec3 vertices = r.indices.at[primitive];
  vec3 weights = vec3(1.0f - u - v, u, v);
  TexturePlace place;
  place.uv = place.uv_1 = vec2(0.0f);
  float vertex_alpha = 1.0f;
  if ((r.flags & instance_has_uvs) != 0u) place.uv = uv_between(r.uvs, vertices, weights);
  if ((r.flags & instance_has_uvs_1) != 0u) place.uv_1 = uv_between(r.uvs_1, vertices, weights);
  if ((r.flags & instance_has_colors) != 0u)
    vertex_alpha = weights.x * r.colors.at[vertices.x].a + weights.y * r.colors.at[vertices.y].a + weights.z * r.colors.at[vertices.z].a;
  float share = coverage(scene, m, place, vertex_alpha);
  if (share <= 0.0f || share >= 1.0f) return share > 0.0f;
  return unit_float(hash(floatBitsToUint(u) ^ hash(floatBitsToUint(v) ^ hash(primitive ^ hash(2u * index + kind))))) < share;
}
#endif
