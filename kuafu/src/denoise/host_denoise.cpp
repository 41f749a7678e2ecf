#include "denoise/host_denoise.h"

#include "pathtrace/host_language.h"

#define KUAFU_CHANNELS 3
namespace kuafu {
namespace {

constexpr uint features = feature_motion;
#include "lib/alike.glsl"
#include "lib/material.glsl"
#include "lib/motion_vector.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

struct Guide {
  const GuidePush& push;
#include "lib/guide.glsl"
#include "lib/history.glsl"
#include "stage/guide.glsl"
};

struct Moments {
  const MomentsPush& push;
#include "stage/moments.glsl"
};

struct Denoise {
  const DenoisePush& push;
#include "stage/denoise.glsl"
};

struct Remodulate {
  const RemodulatePush& push;
#include "lib/guide.glsl"
#include "stage/blend.glsl"
#include "stage/remodulate.glsl"
};

}  // namespace

namespace host {

void guide(const GuidePush& push, uint32_t first, uint32_t end) {
  for (Guide stage{push}; first < end; ++first) stage.guide(first);
}

void moments(const MomentsPush& push, uint32_t first, uint32_t end) {
  for (Moments stage{push}; first < end; ++first) stage.moments(first);
}

void denoise(const DenoisePush& push, uint32_t first, uint32_t end) {
  for (Denoise stage{push}; first < end; ++first) stage.denoise(first);
}

void remodulate(const RemodulatePush& push, uint32_t first, uint32_t end) {
  for (Remodulate stage{push}; first < end; ++first) push.blends != 0 ? stage.blend(first) : stage.remodulate(first);
}

}  // namespace host
}  // namespace kuafu
