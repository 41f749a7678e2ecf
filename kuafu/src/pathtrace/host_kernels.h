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

/// These are of host_aov.cpp, which the build compiles once for each band.
using AovKernel = void(const AovPush& push, uint32_t first, uint32_t end);
AovKernel aov_infrared, aov_visible;

/// How many rays the queues hold that a stage fills. A wave's stages run in one thread, range after range.
struct QueueEnds {
  uint32_t next = 0, shadow = 0;
};

/// These are of host_shade.cpp, which the build compiles once for each band and kind of scene.
using ShadeKernel = void(const ShadePush& push, uint32_t first, uint32_t end, QueueEnds& ends);
using TransmitKernel = void(const TransmitPush& push, uint32_t first, uint32_t end, QueueEnds& ends);
using RelightKernel = void(const ShadePush& push, uint32_t first, uint32_t end);
/// The features that each kind knows. Surfaces of `plain` and `lit` scenes have a BSDF that goes in lanes; `lit` ones have lights with an
/// extent or a profile, as most projectors do. In `worn` scenes some surfaces have lobes of their own, and the others go in lanes.
inline constexpr uint32_t lobe_features = feature_materials | feature_clearcoat | feature_diffuse_transmission | feature_anisotropy |
                                          feature_sheen | feature_iridescence | feature_dispersion;
inline constexpr uint32_t plain_features = feature_lookups, lit_features = plain_features | feature_lights | feature_cutouts,
                          worn_features = lit_features | lobe_features, full_features = ~0u;
ShadeKernel shade_infrared_plain, shade_infrared_lit, shade_infrared_worn, shade_infrared_full, shade_visible_plain, shade_visible_lit,
    shade_visible_worn, shade_visible_full;
TransmitKernel transmit_infrared_plain, transmit_infrared_lit, transmit_infrared_worn, transmit_infrared_full, transmit_visible_plain,
    transmit_visible_lit, transmit_visible_worn, transmit_visible_full;
RelightKernel relight_infrared_plain, relight_infrared_lit, relight_infrared_worn, relight_infrared_full, relight_visible_plain,
    relight_visible_lit, relight_visible_worn, relight_visible_full;

struct SurfaceKernels {
  ShadeKernel* shade;
  TransmitKernel* transmit;
  RelightKernel* relight;
};
/// The ones that know no more than a scene needs. A scene's tracer alone looks at cutouts, but for those that shine.
constexpr SurfaceKernels surface_kernels(bool infrared, uint32_t features) {
  if ((features & ~(plain_features | feature_cutouts)) == 0)
    return infrared ? SurfaceKernels{shade_infrared_plain, transmit_infrared_plain, relight_infrared_plain}
                    : SurfaceKernels{shade_visible_plain, transmit_visible_plain, relight_visible_plain};
  if ((features & ~lit_features) == 0)
    return infrared ? SurfaceKernels{shade_infrared_lit, transmit_infrared_lit, relight_infrared_lit}
                    : SurfaceKernels{shade_visible_lit, transmit_visible_lit, relight_visible_lit};
  if ((features & ~worn_features) == 0)
    return infrared ? SurfaceKernels{shade_infrared_worn, transmit_infrared_worn, relight_infrared_worn}
                    : SurfaceKernels{shade_visible_worn, transmit_visible_worn, relight_visible_worn};
  return infrared ? SurfaceKernels{shade_infrared_full, transmit_infrared_full, relight_infrared_full}
                  : SurfaceKernels{shade_visible_full, transmit_visible_full, relight_visible_full};
}

}  // namespace kuafu::host
