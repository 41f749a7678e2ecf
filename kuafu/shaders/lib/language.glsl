// What lets the functions of lib/ and stage/ compile as GLSL and as C++ (stages on the host, pathtrace/host_*.cpp): no swizzles of several components,
// references by IN (of what is large), INOUT and OUT, float literals with f.
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

vec2 xy(vec3 v) { return vec2(v.x, v.y); }
vec3 xyz(vec4 v) { return vec3(v.x, v.y, v.z); }
#endif
