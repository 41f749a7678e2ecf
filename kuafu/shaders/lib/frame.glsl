// Orthonormal frames around a normal, and leaving a surface without meeting it again.
#ifndef KUAFU_FRAME_GLSL
#define KUAFU_FRAME_GLSL

struct Frame {
  vec3 tangent, bitangent, normal;
};

// Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017.
Frame frame_around(vec3 n) {
  float s = n.z >= 0.0 ? 1.0 : -1.0;
  float a = -1.0 / (s + n.z);
  float b = n.x * n.y * a;
  return Frame(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

vec3 to_local(Frame f, vec3 w) { return vec3(dot(f.tangent, w), dot(f.bitangent, w), dot(f.normal, w)); }
vec3 to_world(Frame f, vec3 v) { return f.tangent * v.x + f.bitangent * v.y + f.normal * v.z; }

// Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems 2019: steps in ulps, absolute near the origin.
vec3 offset_origin(vec3 position, vec3 outward) {
  ivec3 step = ivec3(256.0 * outward);
  vec3 far = intBitsToFloat(floatBitsToInt(position) + mix(step, -step, lessThan(position, vec3(0.0))));
  return mix(far, position + outward * (1.0 / 65536.0), lessThan(abs(position), vec3(1.0 / 32.0)));
}
#endif
