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

/// Whether all paths are at surfaces without layer, metal and glass. Loops that know it compute the base alone, with the same results.
[[gnu::always_inline]] inline bool are_matt(const BandLanes& lanes) {
  float most = 0.0f;
  for (uint l = 0; l < host::lane_count; ++l) most = max(most, max(lanes.metallic[l], max(lanes.coat[l], lanes.transmission[l])));
  return most == 0.0f;
}

template <bool matt>
Bsdf bsdf_of(const BandLanes& lanes, uint l) {
  auto m = host::material_point<MaterialPoint>(lanes, l);
  if (matt) m.metallic = m.coat = m.transmission = 0.0f;
  return make_bsdf(m, lanes.table, host::vector_of(lanes.wo, l), true);  // sides differ for glass alone, which is not sampled here
}

template <bool matt>
[[gnu::always_inline]] inline void evaluate_lanes(BandLanes& lanes) {
#pragma GCC ivdep
  for (uint l = 0; l < host::lane_count; ++l) {
    const Bsdf b = bsdf_of<matt>(lanes, l);
    float pdf;
    const Spectrum f = bsdf_evaluate(b, lanes.table, host::vector_of(lanes.wo, l), host::vector_of(lanes.wi, l), lobe_chances(b), pdf);
    lanes.pdf[l] = pdf;
    for (uint c = 0; c < channels; ++c) lanes.f[c][l] = channel_of(f, c);
  }
}

template <bool matt>
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
    const Bsdf b = bsdf_of<matt>(lanes, l);
    const vec3 chances = lobe_chances(b);
    const bool lobe = !matt && lanes.choice[l] < chances.z + chances.y;
    const BsdfSample s = sample_opaque(b, lanes.table, host::vector_of(lanes.wo, l), chances, vec2(lanes.u[0][l], lanes.u[1][l]), lobe);
    for (uint c = 0; c < channels; ++c) lanes.weight[c][l] = channel_of(s.weight, c);
    for (int i = 0; i < 3; ++i) lanes.direction[i][l] = s.direction[i];
    lanes.sampled_pdf[l] = s.pdf;
    lanes.delta[l] = !matt && (lanes.choice[l] < chances.z || (lobe && is_mirror(b))) ? 1u : 0u;
  }
}

}  // namespace

namespace host {

void evaluate(BandLanes& lanes) {
  if (are_matt(lanes))
    in_vectors([&] { evaluate_lanes<true>(lanes); });
  else
    in_vectors([&] { evaluate_lanes<false>(lanes); });
}

void scatter(BandLanes& lanes) {
  if (are_matt(lanes))
    in_vectors([&] { sample_lanes<true>(lanes); });
  else
    in_vectors([&] { sample_lanes<false>(lanes); });
}

}  // namespace host
}  // namespace kuafu
