// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer` compiled as C++. BSDFs go in lanes.
#include <type_traits>

#include "frame/host_language.h"
#include "gbuffer/gbuffer_light.h"
#include "pathtrace/host_lanes.h"

#define KUAFU_CHANNELS 1
namespace kuafu {
namespace {

constexpr uint features = 0;
inline void atomicMin(uint& word, uint value) {
  std::atomic_ref<uint> shared(word);
  for (uint before = shared.load(); value < before && !shared.compare_exchange_weak(before, value);) {
  }
}
inline void atomicMax(uint& word, uint value) {
  std::atomic_ref<uint> shared(word);
  for (uint before = shared.load(); value > before && !shared.compare_exchange_weak(before, value);) {
  }
}
#include "lib/frame.glsl"
#include "lib/pattern_mean.glsl"
#include "lib/pixels.glsl"
#include "lib/reflected.glsl"

struct Gbuffer {
  const GbufferPush& push;
  const uint step = push.step;
#include "stage/gbuffer.glsl"
#include "stage/gbuffer_blend.glsl"
#include "stage/gbuffer_bounce.glsl"
#include "stage/gbuffer_lobes.glsl"
#include "stage/gbuffer_warp.glsl"
};

constexpr uint lane_count = host::lane_count;
template <class T>
using Lanes = host::Lanes<T>;
using Floats = Lanes<float>;

struct alignas(64) VertexLanes {
  Floats base, metallic, roughness, specular, ior, transmission, coat, wo[3], wi[3];
  Floats f, matt, lobes;
};

void put(const Gbuffer::GbufferVertex& v, VertexLanes& lanes, uint l) {
  lanes.base[l] = v.material.base;
  lanes.metallic[l] = v.material.metallic;
  lanes.roughness[l] = v.material.roughness;
  lanes.specular[l] = v.material.specular;
  lanes.ior[l] = v.material.ior;
  lanes.transmission[l] = v.material.transmission;
  lanes.coat[l] = v.material.coat;
  for (int k = 0; k < 3; ++k) lanes.wo[k][l] = v.wo[k], lanes.wi[k][l] = v.wi[k];
}

/// Surfaces without layer, metal and glass are the base alone, with the same results.
template <bool matt>
[[gnu::always_inline]] inline void reflect_lanes(VertexLanes& lanes, Vec2Array table) {
#pragma GCC ivdep
  for (uint l = 0; l < lane_count; ++l) {
    MaterialPoint m{};
    m.base = lanes.base[l];
    m.metallic = matt ? 0.0f : lanes.metallic[l];
    m.roughness = lanes.roughness[l];
    m.specular = lanes.specular[l];
    m.ior = lanes.ior[l];
    m.transmission = matt ? 0.0f : lanes.transmission[l];
    m.coat = matt ? 0.0f : lanes.coat[l];
    const Reflected r = reflected(m, table, host::vector_of(lanes.wo, l), host::vector_of(lanes.wi, l));
    lanes.f[l] = r.f;
    lanes.matt[l] = r.matt;
    lanes.lobes[l] = r.lobes;
  }
}

bool are_matt(const VertexLanes& lanes) {
  float most = 0.0f;
  for (uint l = 0; l < lane_count; ++l) most = max(most, max(lanes.metallic[l], max(lanes.coat[l], lanes.transmission[l])));
  return most == 0.0f;
}

/// The place of pixel i, the one after `before`.
Gbuffer::GbufferPlace next_place(Gbuffer& stage, Gbuffer::GbufferPlace before, uint i) {
  if (before.column + 1 == stage.push.record.at[0].width) return stage.gbuffer_place(i);
  ++before.column;
  ++before.pixel;
  return before;
}

#include "gbuffer/host_bounce_lanes.inc"

void light_pixels(Gbuffer& stage, uint first, uint end) {
  const Vec2Array table = stage.push.record.at[0].scene.at[0].specular_albedo;
  VertexLanes lanes{};
  Gbuffer::GbufferPlace places[lane_count];
  Gbuffer::GbufferVertex vertices[lane_count];
  for (; first < end; first += lane_count) {
    const uint count = min(lane_count, end - first);
    host::in_vectors([&] {
      for (uint l = 0; l < count; ++l) {
        places[l] = l > 0 ? next_place(stage, places[l - 1], first + l) : stage.gbuffer_place(first);
        vertices[l] = stage.vertex_at(places[l]);
        put(vertices[l], lanes, l);
      }
    });
    if (are_matt(lanes))
      host::in_vectors([&] { reflect_lanes<true>(lanes, table); });
    else
      host::in_vectors([&] { reflect_lanes<false>(lanes, table); });
    for (uint l = 0; l < count; ++l) stage.write_vertex(first + l, places[l], vertices[l], {lanes.f[l], lanes.matt[l], lanes.lobes[l]});
  }
}

}  // namespace

void host::gbuffer(const GbufferPush& push, uint32_t first, uint32_t end) {
  Gbuffer stage{push};
  if (push.step == gbuffer_light) return light_pixels(stage, first, end);
  host::in_vectors([&] {
    if (push.step == gbuffer_sky) return look_around(stage, first, end);
    if (push.step == gbuffer_bounce) return bounce_pixels(stage, first, end);
    for (uint32_t i = first; i < end; ++i) stage.gbuffer_step(i);
  });
}

}  // namespace kuafu
