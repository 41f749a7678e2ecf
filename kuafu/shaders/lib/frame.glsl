// SPDX-License-Identifier: Apache-2.0
// Orthonormal frames around a normal, and leaving a surface without meeting it again.
#ifndef KUAFU_FRAME_GLSL
#define KUAFU_FRAME_GLSL

struct Frame {
  vec3 tangent, bitangent, normal;
};

// Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017.
Frame frame_around(vec3 n) {
  float s = n.z >= 0.0f ? 1.0f : -1.0f;
  float a = -1.0f / (s + n.z);
  float b = n.x * n.y * a;
  return Frame(vec3(1.0f + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

/// Whose tangent lies along t, which is not the normal's direction.
Frame frame_along(vec3 n, vec3 t) {
  vec3 tangent = normalize(t - n * dot(t, n));
  return Frame(tangent, cross(n, tangent), n);
}

vec3 to_local(Frame f, vec3 w) { return vec3(dot(f.tangent, w), dot(f.bitangent, w), dot(f.normal, w)); }
vec3 to_world(Frame f, vec3 v) { return f.tangent * v.x + f.bitangent * v.y + f.normal * v.z; }

/// Leaves a surface on the side of `outward`. The step is a few ulps of the coordinates that the point was made from (after Wächter and Binder, "A Fast and
/// Robust Method for Avoiding Self-Intersection", Ray Tracing Gems 2019), along the normal alone, so that it never crosses a neighbouring wall of a corner.
vec3 offset_origin(vec3 position, float coordinate_size, vec3 outward) { return position + outward * (coordinate_size * (1.0f / 131072.0f)); }
#endif
