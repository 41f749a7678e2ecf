// SPDX-License-Identifier: Apache-2.0
// The host computes these things for many paths at once, one path in each lane of the machine's vectors, in loops that the compiler
// vectorises; the text is the shaders' own. Each loop is compiled for several kinds of vectors and takes the widest that the machine has,
// with the same results. A lane without a path may hold anything. Thread rule: any thread, each with its own lanes.
#pragma once

#include "shared/wave.h"

#ifdef __x86_64__
#define KUAFU_AVX2 [[gnu::target("avx2"), gnu::flatten]]
#define KUAFU_AVX512 [[gnu::target("avx512f,avx512vl,avx512dq,avx512bw"), gnu::flatten]]
#endif

namespace kuafu::host {

#ifdef __x86_64__
inline bool has_avx512() {
  return __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
}
inline bool has_avx2() { return __builtin_cpu_supports("avx2"); }
#endif

#ifdef __x86_64__
template <class Loops>
KUAFU_AVX2 void in_avx2(const Loops& loops) {
  loops();
}
template <class Loops>
KUAFU_AVX512 void in_avx512(const Loops& loops) {
  loops();
}
#endif
/// Runs loops over lanes in the machine's widest vectors.
template <class Loops>
void in_vectors(const Loops& loops) {
#ifdef __x86_64__
  if (has_avx512()) return in_avx512(loops);
  if (has_avx2()) return in_avx2(loops);
#endif
  loops();
}

constexpr uint32_t lane_count = 32;
template <class T>
using Lanes = T[lane_count];

/// Pixel samples (lib/pixel_sample.glsl).
struct alignas(64) PixelSampleLanes {
  Lanes<uint32_t> view_key, pixel;
  Lanes<uint32_t> index;  // in: of the pixel's samples; out: in the path's sequence
  Lanes<uint32_t> key;    // this and the rest are as PixelSample has them
  Lanes<float> offset_x, offset_y;
};
void sample_pixels(PixelSampleLanes& lanes, bool replicates);

/// BSDFs of surfaces without special features (lib/bsdf.glsl), which take most of the time of stage `shade`.
template <uint32_t channels>
struct alignas(64) ScatterLanes {
  Vec2Array table;  // SceneAddresses.specular_albedo
  uint32_t bounce;
  Lanes<uint32_t> key, index;  // of the path's samples
  Lanes<float> base[channels], metallic, roughness, specular, ior, transmission, coat;
  Lanes<float> wo[3], wi[3];

  Lanes<float> f[channels], pdf;                      // towards wi
  Lanes<float> choice, roulette;                      // as stage `shade` draws them
  Lanes<float> u[2], direction[3], weight[channels];  // where the path goes on, unless `delta` is set
  Lanes<float> sampled_pdf;                           // of that direction
  Lanes<uint32_t> delta;                              // nonzero: a mirror or glass sends it on, and no lane computes that
};
/// Evaluates f for the direction wi, and its density.
void evaluate(ScatterLanes<1>& lanes);
void evaluate(ScatterLanes<3>& lanes);
/// Samples directions, with weight and density.
void scatter(ScatterLanes<1>& lanes);
void scatter(ScatterLanes<3>& lanes);

inline glm::vec3 vector_of(const Lanes<float>* v, uint32_t lane) { return {v[0][lane], v[1][lane], v[2][lane]}; }
/// A lane's spectrum: float in the infrared band, else vec3.
template <uint32_t channels>
auto spectrum_of(const Lanes<float>* s, uint32_t lane) {
  if constexpr (channels == 1)
    return s[0][lane];
  else
    return vector_of(s, lane);
}
/// A lane's surface point. The lanes hold only MaterialPoint's fields.
template <class Point, uint32_t channels>
Point material_point(const ScatterLanes<channels>& lanes, uint32_t lane) {
  Point m{};
  m.base = spectrum_of<channels>(lanes.base, lane);
  m.metallic = lanes.metallic[lane];
  m.roughness = lanes.roughness[lane];
  m.specular = lanes.specular[lane];
  m.ior = lanes.ior[lane];
  m.transmission = lanes.transmission[lane];
  m.coat = lanes.coat[lane];
  return m;
}

}  // namespace kuafu::host
