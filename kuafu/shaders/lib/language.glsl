// SPDX-License-Identifier: Apache-2.0
// What lets the functions of lib/ and stage/ compile as GLSL and as C++ (stages on the host, pathtrace/host_*.cpp): no swizzles of several components,
// references by IN (of what is large; of records in tables, too), INOUT and OUT, float literals with f.
#ifndef KUAFU_LANGUAGE_GLSL
#define KUAFU_LANGUAGE_GLSL

#ifdef __cplusplus
#define INOUT(T) T&
#define OUT(T) T&
#define IN(T) const T&
#else
#define INOUT(T) inout T
#define OUT(T) out T
#define IN(T) T
#endif

/// (cos, sin) of 2 pi u, u in [0, 1].
#ifdef __cplusplus
// Polynomials for an eighth of the circle either way (Moshier, Cephes), off by 1e-7 at most: no call, so that loops over paths vectorise.
vec2 unit_circle(float u) {
  int quarter = int(4.0f * u + 0.5f);
  float x = (u - 0.25f * float(quarter)) * 6.283185307f, x2 = x * x;
  float s = x + x * x2 * (-1.6666654611e-1f + x2 * (8.3321608736e-3f - x2 * 1.9515295891e-4f));
  float c = 1.0f - 0.5f * x2 + x2 * x2 * (4.166664568298827e-2f + x2 * (-1.388731625493765e-3f + x2 * 2.443315711809948e-5f));
  bool odd = (quarter & 1) != 0;
  float a = odd ? s : c, b = odd ? c : s;
  return vec2(((quarter + 1) & 2) != 0 ? -a : a, (quarter & 2) != 0 ? -b : b);
}
#else
vec2 unit_circle(float u) { return vec2(cos(6.283185307f * u), sin(6.283185307f * u)); }
#endif

vec2 xy(vec3 v) { return vec2(v.x, v.y); }
vec3 xyz(vec4 v) { return vec3(v.x, v.y, v.z); }
#endif
