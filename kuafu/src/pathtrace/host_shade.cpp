// SPDX-License-Identifier: Apache-2.0
// Stages `shade`, `transmit`, `gather`, `send` and `follow` on the host. The build compiles this file once for each band and kind of scene:
// KUAFU_CHANNELS and KUAFU_FEATURES say which, KUAFU_HOST_KIND ends the functions' names.
#include <algorithm>
#include <vector>

#include "frame/host_language.h"
#include "pathtrace/host_kernels.h"
#include "pathtrace/host_lanes.h"

#define KUAFU_JOIN(stage, kind) stage##_##kind
#define KUAFU_JOINED(stage, kind) KUAFU_JOIN(stage, kind)
#define KUAFU_NAME(stage) KUAFU_JOINED(stage, KUAFU_HOST_KIND)

namespace kuafu {
namespace {

constexpr uint features = KUAFU_FEATURES;
constexpr uint32_t most_prefetched = 16;  // beams of a bucket
#include "lib/refraction.glsl"
#include "lib/shading.glsl"
#include "lib/splat_table.glsl"

struct Shade {
  const ShadePush& push;
#include "stage/shade.glsl"

#include "stage/gather.glsl"
};

struct Transmit {
  const TransmitPush& push;
#include "stage/transmit.glsl"
};

struct Follow {
  const BeamPush& push;
#include "stage/follow.glsl"
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

/// Landed light stands anywhere in memory, in three places that lead one to the next: a block of paths asks for each of them together.
void gather_block(Shade& stage, uint32_t first, uint32_t end) {
  static thread_local std::vector<Shade::Gathering> gatherings;
  static thread_local std::vector<uint32_t> rays;
  static thread_local std::vector<const uint32_t*> heads;
  gatherings.clear(), rays.clear(), heads.clear();
  const SplatTable& table = stage.push.splats.at[0];
  for (uint32_t i = first; i < end; ++i) {
    const Shade::Gathering g = stage.begin_gathering(i);
    if (!g.wanted) continue;
    gatherings.push_back(g);
    rays.push_back(i);
    for (uint32_t k = 0; k < stage.gathered_lights(); ++k) {
      const LightChoice light = stage.gathered_light(g, k);
      if (light.probability == 0.0f) continue;
      for (uint32_t levels = table.words.at[splat_levels]; levels != 0; levels &= levels - 1) {
        const int level = findLSB(levels) + splat_least_level;
        const uint32_t bucket = bucket_of(table, cell_of(g.position, level), level, light.index, stage.path_environment(g.path));
        heads.push_back(table.words.at + head_word(bucket));
        __builtin_prefetch(heads.back());
      }
    }
  }
  const uint32_t* const entries = table.words.at + entry_word(table, 0);
  for (const uint32_t* head : heads)
    if (head[1] > 0) __builtin_prefetch(entries + head[0]);
  for (const uint32_t* head : heads)
    for (uint32_t k = 0; k < std::min(head[1], most_prefetched); ++k) {
      const auto* beam = reinterpret_cast<const char*>(table.beams.at + entries[head[0] + k]);
      __builtin_prefetch(beam);
      __builtin_prefetch(beam + 64);
    }
  for (size_t k = 0; k < rays.size(); ++k) stage.gather(rays[k], gatherings[k]);
}

#if KUAFU_IN_LANES
#include "pathtrace/host_shade_block.inc"
#endif

}  // namespace

namespace host {

void KUAFU_NAME(shade)(const ShadePush& push, uint32_t first, uint32_t end, QueueEnds& ends) {
  Shade stage{push};
  Queues queues(stage, ends);
#if KUAFU_IN_LANES
  for (ShadeBlock block(stage, queues); first < end; first = block.shade(first, end)) {
  }
#else
  for (; first < end; ++first) shade_path(stage, queues, first);
#endif
}

void KUAFU_NAME(transmit)(const TransmitPush& push, uint32_t first, uint32_t end, QueueEnds& ends) {
  for (Transmit stage{push}; first < end; ++first) {
    const Transmit::Onward onward = stage.transmit(first);
    if (onward.wanted) stage.queue_onward(first, onward, ends.shadow++);
  }
}

void KUAFU_NAME(gather)(const ShadePush& push, uint32_t first, uint32_t end) {
  constexpr uint32_t block = 32;
  Shade stage{push};
  for (; first < end; first += block) gather_block(stage, first, std::min(end, first + block));
}

void KUAFU_NAME(send)(const BeamPush& push, uint32_t first, uint32_t end) {
  for (Follow stage{push}; first < end; ++first) stage.send_beam(first);
}

void KUAFU_NAME(follow)(const BeamPush& push, uint32_t first, uint32_t end, QueueEnds& ends) {
  for (Follow stage{push}; first < end; ++first) {
    const Follow::Segment onward = stage.follow_beam(first);
    if (onward.wanted) stage.queue_beam(onward, ends.next++);
  }
}

}  // namespace host
}  // namespace kuafu
