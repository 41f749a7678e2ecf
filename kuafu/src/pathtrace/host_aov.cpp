// SPDX-License-Identifier: Apache-2.0
// Stage `aov` on the host. The build compiles this file once for each band: KUAFU_CHANNELS says which, KUAFU_HOST_AOV names the function.
#include "frame/host_language.h"
#include "pathtrace/host_kernels.h"

namespace kuafu {
namespace {

constexpr uint features = feature_camera | feature_motion | feature_lookups;
#include "lib/camera.glsl"
#include "lib/material.glsl"
#include "lib/motion_vector.glsl"
#include "lib/pixels.glsl"
#include "lib/projector_view.glsl"
#include "lib/queue.glsl"

struct Aov {
  const AovPush& push;
#include "stage/aov.glsl"
};

}  // namespace

namespace host {

void KUAFU_HOST_AOV(const AovPush& push, uint32_t first, uint32_t end) {
  for (Aov stage{push}; first < end; ++first) stage.aov(first);
}

}  // namespace host
}  // namespace kuafu
