// SPDX-License-Identifier: Apache-2.0
// Stages `shade`, `transmit` and `relight` on the host. The build compiles this file once for each band and kind of scene: KUAFU_CHANNELS
// and KUAFU_FEATURES say which, KUAFU_HOST_SHADE, KUAFU_HOST_TRANSMIT and KUAFU_HOST_RELIGHT name the functions.
#include <memory>

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

struct QueuedOnward {
  uint32_t from;
  Transmit::Onward onward;
};

/// The rays that a chunk of paths asks for, until they have their places in the queues.
class Queued {
 public:
  Queued(uint32_t paths, uint32_t shadow_rays_per_vertex)
      : shadows_(std::make_unique_for_overwrite<Shadow[]>(size_t(paths) * shadow_rays_per_vertex + 1)),
        nexts_(std::make_unique_for_overwrite<Next[]>(paths)) {}
  /// Where the next request is written, for keep(). A struct that is made elsewhere and copied here costs more than all of its arithmetic:
  /// the copy reads with one load what several stores have just written, which processors wait for.
  Shade::ShadowRequest& place(const Shade::Path& path, uint32_t k) {
    Shadow& shadow = shadows_[shadow_count_];
    shadow.path = path;
    shadow.k = k;
    return shadow.request;
  }
  void keep() { ++shadow_count_; }
  void next(const Shade::Path& path, const Shade::NextRequest& request) {
    if (request.wanted) nexts_[next_count_++] = {path, request};
  }
  void store(Shade& stage, host::QueuePlaces& places, size_t chunk) const {
    const host::QueuePlaces::Places mine = places.take(chunk, next_count_, shadow_count_);
    for (uint32_t i = 0; i < shadow_count_; ++i) stage.queue_shadow(shadows_[i].path, shadows_[i].request, shadows_[i].k, mine.shadow + i);
    for (uint32_t i = 0; i < next_count_; ++i) stage.queue_next(nexts_[i].path, nexts_[i].request, mine.next + i);
  }

 private:
  struct Shadow {
    Shade::Path path;
    Shade::ShadowRequest request;
    uint32_t k;
  };
  struct Next {
    Shade::Path path;
    Shade::NextRequest request;
  };

  std::unique_ptr<Shadow[]> shadows_;
  std::unique_ptr<Next[]> nexts_;
  uint32_t shadow_count_ = 0, next_count_ = 0;
};

#if KUAFU_IN_LANES
#include "pathtrace/host_shade_block.inc"

void shade_range(Shade& stage, Queued& queued, uint32_t first, uint32_t end) {
  ShadeBlock block(stage, queued);
  while (first < end) {
    first = block.arrive(first, end);
    block.ask_lights();
    block.go_on();
  }
}
#else
void shade_range(Shade& stage, Queued& queued, uint32_t first, uint32_t end) {
  for (uint32_t i = first; i < end; ++i) {
    Shade::Shading shading = stage.begin_shading(i);
    for (uint32_t k = 0; k < stage.push.shadow_rays_per_vertex; ++k) {
      Shade::ShadowRequest& request = queued.place(shading.path, k);
      request.wanted = false;
      if (stage.asks_light(shading, k)) request = stage.ask_light(shading, k);
      if (request.wanted)
        queued.keep();
      else
        stage.queue_no_shadow(shading.path, k);
    }
    if (!stage.goes_on(shading)) continue;
    const Shade::NextRequest next = stage.scatter(shading);
    queued.next(shading.path, next);
  }
}
#endif

}  // namespace

namespace host {

void KUAFU_HOST_SHADE(const ShadePush& push, uint32_t first, uint32_t end, QueuePlaces& places, size_t chunk) {
  Shade stage{push};
  Queued queued(end - first, push.shadow_rays_per_vertex);
  shade_range(stage, queued, first, end);
  queued.store(stage, places, chunk);
}

void KUAFU_HOST_TRANSMIT(const TransmitPush& push, uint32_t first, uint32_t end, QueuePlaces& places, size_t chunk) {
  Transmit stage{push};
  const auto onwards = std::make_unique_for_overwrite<QueuedOnward[]>(end - first);
  uint32_t count = 0;
  for (uint32_t i = first; i < end; ++i) {
    onwards[count] = {i, stage.transmit(i)};
    if (onwards[count].onward.wanted) ++count;
  }
  const uint32_t mine = places.take(chunk, 0, count).shadow;
  for (uint32_t i = 0; i < count; ++i) stage.queue_onward(onwards[i].from, onwards[i].onward, mine + i);
}

void KUAFU_HOST_RELIGHT(const ShadePush& push, uint32_t first, uint32_t end) {
  for (Shade stage{push}; first < end; ++first) stage.relight(first);
}

}  // namespace host
}  // namespace kuafu
