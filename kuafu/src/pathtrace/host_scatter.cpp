// SPDX-License-Identifier: Apache-2.0
// BSDFs of surfaces without features of their own, in lanes. The build compiles this file once for each band: KUAFU_CHANNELS says which.
#include "frame/host_language.h"
#include "pathtrace/host_lanes.h"

namespace kuafu {
namespace {

constexpr uint features = 0;
#include "lib/bsdf.glsl"
#include "lib/sequence.glsl"

using BandLanes = host::ScatterLanes<channels>;

Bsdf bsdf_of(const BandLanes& lanes, uint l) {
  MaterialPoint m{};
  m.base = host::spectrum_of<channels>(lanes.base, l);
  m.metallic = lanes.metallic[l];
  m.roughness = lanes.roughness[l];
  m.specular = lanes.specular[l];
  m.ior = lanes.ior[l];
  m.transmission = lanes.transmission[l];
  m.coat = lanes.coat[l];
  return make_bsdf(m, lanes.table, host::vector_of(lanes.wo, l), true);  // sides differ for glass alone, which is not sampled here
}

[[gnu::always_inline]] inline void evaluate_lanes(BandLanes& lanes) {
#pragma GCC ivdep
  for (uint l = 0; l < host::lane_count; ++l) {
    const Bsdf b = bsdf_of(lanes, l);
    float pdf;
    const Spectrum f = bsdf_evaluate(b, lanes.table, host::vector_of(lanes.wo, l), host::vector_of(lanes.wi, l), lobe_chances(b), pdf);
    lanes.pdf[l] = pdf;
    for (uint c = 0; c < channels; ++c) lanes.f[c][l] = channel_of(f, c);
  }
}

[[gnu::always_inline]] inline void sample_lanes(BandLanes& lanes) {
#pragma GCC ivdep
  for (uint l = 0; l < host::lane_count; ++l) {
    const vec2 u = sample_2d(lanes.key[l], lanes.index[l], pair_direction(lanes.bounce));
    const vec2 choice = sample_2d(lanes.key[l], lanes.index[l], pair_choice(lanes.bounce));
    lanes.u[0][l] = u.x;
    lanes.u[1][l] = u.y;
    lanes.choice[l] = choice.x;
    lanes.roulette[l] = choice.y;
  }
#pragma GCC ivdep
  for (uint l = 0; l < host::lane_count; ++l) {
    const Bsdf b = bsdf_of(lanes, l);
    const vec3 chances = lobe_chances(b);
    const bool lobe = lanes.choice[l] < chances.z + chances.y;
    const BsdfSample s = sample_opaque(b, lanes.table, host::vector_of(lanes.wo, l), chances, vec2(lanes.u[0][l], lanes.u[1][l]), lobe);
    for (uint c = 0; c < channels; ++c) lanes.weight[c][l] = channel_of(s.weight, c);
    for (int i = 0; i < 3; ++i) lanes.direction[i][l] = s.direction[i];
    lanes.sampled_pdf[l] = s.pdf;
    lanes.delta[l] = lanes.choice[l] < chances.z || (lobe && is_mirror(b)) ? 1u : 0u;
  }
}

}  // namespace

namespace host {

#ifdef __x86_64__
namespace {
KUAFU_AVX2 void evaluate_avx2(BandLanes& lanes) { evaluate_lanes(lanes); }
KUAFU_AVX2 void scatter_avx2(BandLanes& lanes) { sample_lanes(lanes); }
KUAFU_AVX512 void evaluate_avx512(BandLanes& lanes) { evaluate_lanes(lanes); }
KUAFU_AVX512 void scatter_avx512(BandLanes& lanes) { sample_lanes(lanes); }
}  // namespace
#endif

void evaluate(BandLanes& lanes) {
#ifdef __x86_64__
  if (has_avx512()) return evaluate_avx512(lanes);
  if (has_avx2()) return evaluate_avx2(lanes);
#endif
  evaluate_lanes(lanes);
}

void scatter(BandLanes& lanes) {
#ifdef __x86_64__
  if (has_avx512()) return scatter_avx512(lanes);
  if (has_avx2()) return scatter_avx2(lanes);
#endif
  sample_lanes(lanes);
}

}  // namespace host
}  // namespace kuafu
