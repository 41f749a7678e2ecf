// SPDX-License-Identifier: Apache-2.0
#include "accel/embree_cutout.h"

#include <algorithm>

#include "accel/embree_library.h"
#include "frame/host_language.h"

namespace kuafu {
namespace {

constexpr uint features = feature_lookups;
#include "lib/cutout.glsl"

bool has_holes(const std::optional<Material>& m) { return m && m->alpha_mode != Material::AlphaMode::opaque; }

void filter(const RTCFilterFunctionNArguments* a) {
  const auto& context = *reinterpret_cast<const EmbreeContext*>(a->context);
  if (context.scene == nullptr) return;
  for (uint32_t i = 0; i < a->N; ++i) {
    if (a->valid[i] == 0) continue;
    const uint32_t instance = context.instances[RTCHitN_instID(a->hit, a->N, i, 0)];
    if (!stands_at(*context.scene, instance, RTCHitN_primID(a->hit, a->N, i), RTCHitN_u(a->hit, a->N, i), RTCHitN_v(a->hit, a->N, i),
                   context.kind))
      a->valid[i] = 0;
  }
}

}  // namespace

std::unordered_set<uint32_t> meshes_with_cutouts(const Scene& scene) {
  if (std::ranges::none_of(scene.materials(), has_holes)) return {};
  std::unordered_set<uint32_t> out;
  for (const auto& instance : scene.instances())
    if (instance && std::ranges::any_of(instance->materials, [&](uint32_t id) { return id != none && has_holes(scene.materials()[id]); }))
      out.insert(instance->mesh);
  return out;
}

void set_cutout_filter(RTCGeometry geometry) {
  rtcSetGeometryIntersectFilterFunction(geometry, filter);
  rtcSetGeometryOccludedFilterFunction(geometry, filter);
}

}  // namespace kuafu
