// SPDX-License-Identifier: Apache-2.0
// From a hit to a point on a surface.
#ifndef KUAFU_SURFACE_GLSL
#define KUAFU_SURFACE_GLSL
#include "lib/language.glsl"
#include "lib/motion.glsl"
#include "lib/texture.glsl"

/// Where a ray ended.
struct MetSurface {
  uint instance, primitive;
  float u, v;
  float t;  // way to it, metres
};

struct Surface {
  vec3 position;
  float coordinate_size;  // largest coordinate that went into the position, metres: its rounding error follows from it
  vec3 geometric_normal;  // outward by winding (counter-clockwise seen from outside)
  vec3 shading_normal;    // same side
  vec3 tangent_u, tangent_v;  // world directions of growing uv, or those that the mesh's tangents have in their place
  vec3 tangent_u_1, tangent_v_1;  // the same of the second set; filled only with feature_lookups
  bool own_tangents;  // the mesh's, which hold for any texture coordinates; read only with feature_lookups
  TexturePlace place;
  vec4 color;  // of the mesh; filled only with feature_lookups
  uint material;  // index into the material table
  uint instance_id;
};

vec3 to_world_normal(IN(InstanceRecord) r, vec3 n) {
  return vec3(dot(r.normal_to_world[0], n), dot(r.normal_to_world[1], n), dot(r.normal_to_world[2], n));
}

vec3 to_world_vector(IN(InstanceRecord) r, vec3 v) {
  return vec3(dot(xyz(r.local_to_world[0]), v), dot(xyz(r.local_to_world[1]), v), dot(xyz(r.local_to_world[2]), v));
}

/// Texture coordinates of a point, and their world directions.
vec2 load_uv(IN(InstanceRecord) r, Vec2Array uvs, uvec3 vertices, vec3 weights, vec3 edge_1, vec3 edge_2, OUT(vec3) tangent_u, OUT(vec3) tangent_v) {
  vec2 uv_0 = uvs.at[vertices.x], uv_1 = uvs.at[vertices.y], uv_2 = uvs.at[vertices.z];
  vec2 d_1 = uv_1 - uv_0, d_2 = uv_2 - uv_0;
  float determinant = d_1.x * d_2.y - d_1.y * d_2.x;
  float scale = determinant < 0.0f ? -1.0f : 1.0f;  // only directions matter
  tangent_u = to_world_vector(r, (edge_1 * d_2.y - edge_2 * d_1.y) * scale);
  tangent_v = to_world_vector(r, (edge_2 * d_1.x - edge_1 * d_2.x) * scale);
  return weights.x * uv_0 + weights.y * uv_1 + weights.z * uv_2;
}

vec4 load_color(IN(InstanceRecord) r, uvec3 vertices, vec3 weights) {
  return weights.x * r.colors.at[vertices.x] + weights.y * r.colors.at[vertices.y] + weights.z * r.colors.at[vertices.z];
}

/// The mesh's tangents, where the vertices have any: u grows along xyz, and v against the bitangent, cross(normal, xyz) * w. That product
/// is taken before the instance's pose, so that a mirrored instance is what a mirror shows.
void load_tangents(IN(InstanceRecord) r, uvec3 vertices, vec3 weights, INOUT(Surface) s) {
  vec4 t = weights.x * r.tangents.at[vertices.x] + weights.y * r.tangents.at[vertices.y] + weights.z * r.tangents.at[vertices.z];
  if (dot(xyz(t), xyz(t)) == 0.0f) return;
  vec3 n = weights.x * r.normals.at[vertices.x] + weights.y * r.normals.at[vertices.y] + weights.z * r.normals.at[vertices.z];
  s.tangent_u = s.tangent_u_1 = to_world_vector(r, xyz(t));
  s.tangent_v = s.tangent_v_1 = to_world_vector(r, cross(xyz(t), n) * t.w);
  s.own_tangents = true;
}

/// Index of a triangle's material.
uint material_of(IN(SceneAddresses) scene, IN(InstanceRecord) r, uint primitive) {
  uint slot = (r.flags & instance_has_slots) != 0u ? r.slots.at[primitive] : 0u;
  return scene.instance_materials.at[r.first_material + min(slot, r.material_count)];
}

// The point comes from the triangle, not from the ray: its error is a few ulps of the vertices, whatever the ray's length.
void set_point(IN(InstanceRecord) r, vec3 p_0, vec3 edge_1, vec3 edge_2, float u, float v, INOUT(Surface) s) {
  vec4 local = vec4(p_0 + u * edge_1 + v * edge_2, 1.0f);
  s.position = vec3(dot(r.local_to_world[0], local), dot(r.local_to_world[1], local), dot(r.local_to_world[2], local));
  vec3 size = abs(s.position) + abs(vec3(r.local_to_world[0].w, r.local_to_world[1].w, r.local_to_world[2].w));
  s.coordinate_size = max(size.x, max(size.y, size.z));
  s.geometric_normal = normalize(to_world_normal(r, cross(edge_1, edge_2)));
}

/// From the normals of a triangle's corners.
vec3 smooth_normal(IN(InstanceRecord) r, vec3 n_0, vec3 n_1, vec3 n_2, vec3 weights, vec3 geometric_normal) {
  vec3 n = to_world_normal(r, weights.x * n_0 + weights.y * n_1 + weights.z * n_2);
  float length_squared = dot(n, n);
  bool some = length_squared > 0.0f;
  n *= inversesqrt(length_squared);
  n = vec3(some ? n.x : geometric_normal.x, some ? n.y : geometric_normal.y, some ? n.z : geometric_normal.z);
  return n * (dot(n, geometric_normal) < 0.0f ? -1.0f : 1.0f);
}

Surface load_surface(IN(SceneAddresses) scene, IN(InstanceRecord) r, uint primitive, float u, float v) {
  uvec3 vertices = r.indices.at[primitive];
  vec3 p_0 = r.positions.at[vertices.x], p_1 = r.positions.at[vertices.y], p_2 = r.positions.at[vertices.z];
  vec3 weights = vec3(1.0f - u - v, u, v), edge_1 = p_1 - p_0, edge_2 = p_2 - p_0;
  Surface s;
  set_point(r, p_0, edge_1, edge_2, u, v, s);
  s.shading_normal = s.geometric_normal;
  if ((r.flags & instance_has_normals) != 0u)
    s.shading_normal = smooth_normal(r, r.normals.at[vertices.x], r.normals.at[vertices.y], r.normals.at[vertices.z], weights, s.geometric_normal);
  s.place.uv = s.place.uv_1 = vec2(0.0f);
  s.tangent_u = s.tangent_v = s.tangent_u_1 = s.tangent_v_1 = vec3(0.0f);
  s.color = vec4(1.0f);
  if ((r.flags & instance_has_uvs) != 0u) s.place.uv = load_uv(r, r.uvs, vertices, weights, edge_1, edge_2, s.tangent_u, s.tangent_v);
  if ((features & feature_lookups) != 0u) {
    if ((r.flags & instance_has_uvs_1) != 0u)
      s.place.uv_1 = load_uv(r, r.uvs_1, vertices, weights, edge_1, edge_2, s.tangent_u_1, s.tangent_v_1);
    if ((r.flags & instance_has_colors) != 0u) s.color = load_color(r, vertices, weights);
    s.own_tangents = false;
    if ((r.flags & instance_has_tangents) != 0u) load_tangents(r, vertices, weights, s);
  }
  s.material = material_of(scene, r, primitive);
  s.instance_id = r.id;
  return s;
}

/// Takes a point of something that moves from its place at t = 0 to that of another time.
void move_surface(IN(MotionRecord) m, float time_s, INOUT(Surface) s) {
  s.position = moved_point(m, time_s, s.position);
  vec3 size = abs(s.position) + abs(m.pivot);
  s.coordinate_size = max(s.coordinate_size, max(size.x, max(size.y, size.z)));
  s.geometric_normal = moved_direction(m, time_s, s.geometric_normal);
  s.shading_normal = moved_direction(m, time_s, s.shading_normal);
  s.tangent_u = moved_direction(m, time_s, s.tangent_u);
  s.tangent_v = moved_direction(m, time_s, s.tangent_v);
  if ((features & feature_lookups) != 0u) {
    s.tangent_u_1 = moved_direction(m, time_s, s.tangent_u_1);
    s.tangent_v_1 = moved_direction(m, time_s, s.tangent_v_1);
  }
}

/// load_surface of instance `index` at a time.
Surface surface_at(IN(SceneAddresses) scene, uint index, uint primitive, float u, float v, float time_s) {
  Surface s = load_surface(scene, scene.instances.at[index], primitive, u, v);
  if ((features & feature_motion) != 0u && scene.moves != 0u) {
    IN(MotionRecord) m = scene.instance_motions.at[index];
    if (m.moves != 0u) move_surface(m, time_s, s);
  }
  return s;
}
#endif
