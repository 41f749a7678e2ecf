// SPDX-License-Identifier: Apache-2.0
// How a beam of rays goes through smooth glass: the derivatives of a ray by its direction at the start, carried through space and refraction (Igehy,
// "Tracing Ray Differentials", SIGGRAPH 1999), with the curvature that interpolated normals give a triangle. Normal maps do not bend the beam.
#ifndef KUAFU_REFRACTION_GLSL
#define KUAFU_REFRACTION_GLSL
#include "lib/frame.glsl"
#include "lib/surface.glsl"

/// Derivatives of a ray's position and direction by two angles of its direction at the start.
struct Differential {
  vec3 position_u, position_v, direction_u, direction_v;
};

/// How the normal of a triangle changes over it.
struct NormalField {
  vec3 normal;            // unit, as Surface.shading_normal
  vec3 edge_1, edge_2;    // world
  vec3 plane;             // their cross product over its squared length
  vec3 along_1, along_2;  // change of the normal along an edge; 0 on a flat triangle
};

NormalField normal_field(IN(SceneAddresses) scene, uint index, uint primitive, float u, float v, float time_s, vec3 side) {
  IN(InstanceRecord) r = scene.instances.at[index];
  uvec3 vertices = r.indices.at[primitive];
  vec3 p_0 = r.positions.at[vertices.x];
  NormalField f;
  f.edge_1 = to_world_vector(r, r.positions.at[vertices.y] - p_0);
  f.edge_2 = to_world_vector(r, r.positions.at[vertices.z] - p_0);
  f.normal = side;
  f.along_1 = f.along_2 = vec3(0.0f);
  bool moves = false;
  if ((features & feature_motion) != 0u && scene.moves != 0u) {
    IN(MotionRecord) m = scene.instance_motions.at[index];
    moves = m.moves != 0u;
    if (moves) {
      f.edge_1 = moved_direction(m, time_s, f.edge_1);
      f.edge_2 = moved_direction(m, time_s, f.edge_2);
    }
  }
  vec3 area = cross(f.edge_1, f.edge_2);
  f.plane = area / max(dot(area, area), 1e-37f);
  if ((r.flags & instance_has_normals) == 0u) return f;
  vec3 n_0 = r.normals.at[vertices.x], n_1 = r.normals.at[vertices.y] - n_0, n_2 = r.normals.at[vertices.z] - n_0;
  vec3 n = to_world_normal(r, n_0 + u * n_1 + v * n_2);
  float size = length(n);
  if (size == 0.0f) return f;
  vec3 along_1 = to_world_normal(r, n_1) / size, along_2 = to_world_normal(r, n_2) / size;
  n /= size;
  if (moves) {
    IN(MotionRecord) m = scene.instance_motions.at[index];
    n = moved_direction(m, time_s, n);
    along_1 = moved_direction(m, time_s, along_1);
    along_2 = moved_direction(m, time_s, along_2);
  }
  float turn = dot(n, side) < 0.0f ? -1.0f : 1.0f;
  f.normal = n * turn;
  f.along_1 = (along_1 - n * dot(n, along_1)) * turn;
  f.along_2 = (along_2 - n * dot(n, along_2)) * turn;
  return f;
}

vec3 normal_change(IN(NormalField) f, vec3 way) {
  return f.along_1 * dot(cross(way, f.edge_2), f.plane) + f.along_2 * dot(cross(f.edge_1, way), f.plane);
}

/// On a plane that the ray meets after `t` metres.
vec3 carried(vec3 position, vec3 change, float t, vec3 direction, vec3 normal) {
  position += change * t;
  return position - direction * (dot(position, normal) / dot(direction, normal));
}

void carry(INOUT(Differential) d, float t, vec3 direction, vec3 normal) {
  d.position_u = carried(d.position_u, d.direction_u, t, direction, normal);
  d.position_v = carried(d.position_v, d.direction_v, t, direction, normal);
}

/// Snell's law: normal n against the direction, cos_i and cos_t the cosines on both sides, eta = n_before / n_after.
vec3 refracted(vec3 direction, vec3 n, float cos_i, float cos_t, float eta) { return eta * direction + (eta * cos_i - cos_t) * n; }

vec3 refracted_change(vec3 change, vec3 normal_change, vec3 direction, vec3 n, float cos_i, float cos_t, float eta) {
  float cosine_change = -dot(change, n) - dot(direction, normal_change);
  return eta * change + (eta * cos_i - cos_t) * normal_change + (eta - eta * eta * cos_i / cos_t) * cosine_change * n;
}
#endif
