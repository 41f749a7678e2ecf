// SPDX-License-Identifier: Apache-2.0
// The stages' text (shaders/lib, shaders/stage) compiled as C++: each function runs a range of invocations.
// Thread rule: any thread; ranges are independent, and lanes belong to one thread.
#pragma once

#include <cstdint>

#include "shared/wave.h"

namespace kuafu::host {

void generate(const GeneratePush& push, uint32_t first, uint32_t end);
void resolve(const ResolvePush& push, uint32_t first, uint32_t end);
void accumulate(const AccumulatePush& push, uint32_t first, uint32_t end);
void visibility(const AovPush& push, uint32_t first, uint32_t end);
void splat_table(const SplatTablePush& push, uint32_t first, uint32_t end);

/// A kernel of host_aov.cpp, which is compiled once for each band.
using AovKernel = void(const AovPush& push, uint32_t first, uint32_t end);
AovKernel aov_infrared, aov_visible;

/// How many rays the queues hold that a stage fills. A wave's stages run in one thread, range after range.
struct QueueEnds {
  uint32_t next = 0, shadow = 0;
};

/// A kernel of host_shade.cpp, which is compiled once for each band and kind of scene.
using ShadeKernel = void(const ShadePush& push, uint32_t first, uint32_t end, QueueEnds& ends);
using TransmitKernel = void(const TransmitPush& push, uint32_t first, uint32_t end, QueueEnds& ends);
using GatherKernel = void(const ShadePush& push, uint32_t first, uint32_t end);
using SendKernel = void(const BeamPush& push, uint32_t first, uint32_t end);
using FollowKernel = void(const BeamPush& push, uint32_t first, uint32_t end, QueueEnds& ends);
/// The features that each kind knows. Surfaces of `plain` and `lit` scenes have a BSDF that goes in lanes; `lit` ones have lights with an
/// extent or a profile, as most projectors do. In `worn` scenes some surfaces have lobes of their own, and the others go in lanes.
inline constexpr uint32_t lobe_features = feature_materials | feature_clearcoat | feature_diffuse_transmission | feature_anisotropy |
                                          feature_sheen | feature_iridescence | feature_dispersion;
inline constexpr uint32_t plain_features = feature_lookups, lit_features = plain_features | feature_lights | feature_cutouts,
                          worn_features = lit_features | lobe_features, full_features = ~0u;
#define KUAFU_KIND(kind)          \
  ShadeKernel shade_##kind;       \
  TransmitKernel transmit_##kind; \
  GatherKernel gather_##kind;     \
  SendKernel send_##kind;         \
  FollowKernel follow_##kind;     \
  inline constexpr SurfaceKernels kernels_##kind{shade_##kind, transmit_##kind, gather_##kind, send_##kind, follow_##kind};
struct SurfaceKernels {
  ShadeKernel* shade;
  TransmitKernel* transmit;
  GatherKernel* gather;
  SendKernel* send;
  FollowKernel* follow;
};
KUAFU_KIND(infrared_plain)
KUAFU_KIND(infrared_lit)
KUAFU_KIND(infrared_worn)
KUAFU_KIND(infrared_full)
KUAFU_KIND(visible_plain)
KUAFU_KIND(visible_lit)
KUAFU_KIND(visible_worn)
KUAFU_KIND(visible_full)
#undef KUAFU_KIND

/// Returns the kernels with only the features that a scene needs. Cutouts concern the tracer alone, unless they emit light.
constexpr SurfaceKernels surface_kernels(bool infrared, uint32_t features) {
  if ((features & ~(plain_features | feature_cutouts)) == 0) return infrared ? kernels_infrared_plain : kernels_visible_plain;
  if ((features & ~lit_features) == 0) return infrared ? kernels_infrared_lit : kernels_visible_lit;
  if ((features & ~worn_features) == 0) return infrared ? kernels_infrared_worn : kernels_visible_worn;
  return infrared ? kernels_infrared_full : kernels_visible_full;
}

}  // namespace kuafu::host
