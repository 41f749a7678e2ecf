// SPDX-License-Identifier: Apache-2.0
// Stages `shade`, `transmit` and `relight` on the host. The build compiles this file once for each band and kind of scene: KUAFU_CHANNELS
// and KUAFU_FEATURES say which, KUAFU_HOST_SHADE, KUAFU_HOST_TRANSMIT and KUAFU_HOST_RELIGHT name the functions.
#include <algorithm>

#include "frame/host_language.h"
#include "pathtrace/host_kernels.h"
#include "pathtrace/host_lanes.h"

namespace kuafu {
namespace {

constexpr uint features = KUAFU_FEATURES;
#include "lib/shading.glsl"

struct Shade {
  const ShadePush& push;
#include "stage/relight.glsl"
#include "stage/shade.glsl"
};

struct Transmit {
  const TransmitPush& push;
#include "stage/transmit.glsl"
};

/// The queues that the stage fills, from their ends on.
class Queues {
 public:
  Queues(Shade& stage, host::QueueEnds& ends) : stage_(stage), ends_(ends) {}
  void shadow(const Shade::Path& path, const Shade::ShadowRequest& request, uint32_t k) {
    if (request.wanted)
      stage_.queue_shadow(path, request, k, ends_.shadow++);
    else
      stage_.queue_no_shadow(path, k);
  }
  void next(const Shade::Path& path, const Shade::NextRequest& request) {
    if (request.wanted) stage_.queue_next(path, request, ends_.next++);
  }

 private:
  Shade& stage_;
  host::QueueEnds& ends_;
};

void shade_path(Shade& stage, Queues& queues, uint32_t i) {
  Shade::Shading shading = stage.begin_shading(i);
  for (uint32_t k = 0; k < stage.push.shadow_rays_per_vertex; ++k)
    queues.shadow(shading.path, stage.asks_light(shading, k) ? stage.ask_light(shading, k) : stage.no_shadow_request(), k);
  if (!stage.goes_on(shading)) return;
  const Shade::NextRequest next = stage.scatter(shading);
  queues.next(shading.path, next);
}

#if KUAFU_IN_LANES
#include "pathtrace/host_shade_block.inc"
#endif

}  // namespace

namespace host {

void KUAFU_HOST_SHADE(const ShadePush& push, uint32_t first, uint32_t end, QueueEnds& ends) {
  Shade stage{push};
  Queues queues(stage, ends);
#if KUAFU_IN_LANES
  for (ShadeBlock block(stage, queues); first < end; first = block.shade(first, end)) {
  }
#else
  for (; first < end; ++first) shade_path(stage, queues, first);
#endif
}

void KUAFU_HOST_TRANSMIT(const TransmitPush& push, uint32_t first, uint32_t end, QueueEnds& ends) {
  for (Transmit stage{push}; first < end; ++first) {
    const Transmit::Onward onward = stage.transmit(first);
    if (onward.wanted) stage.queue_onward(first, onward, ends.shadow++);
  }
}

void KUAFU_HOST_RELIGHT(const ShadePush& push, uint32_t first, uint32_t end) {
  for (Shade stage{push}; first < end; ++first) stage.relight(first);
}

}  // namespace host
}  // namespace kuafu
