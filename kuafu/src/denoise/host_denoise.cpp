// SPDX-License-Identifier: Apache-2.0
#include "denoise/denoiser.h"

#include "frame/host_language.h"

#define KUAFU_CHANNELS 3
namespace kuafu {
namespace {

constexpr uint features = feature_motion | feature_lookups;
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
  [[nodiscard]] uint denoise_step() const { return push.step; }
  const uint planes = push.images.at[0].denoised_count * push.images.at[0].channels;
  [[nodiscard]] uint plane_count() const { return planes; }
#include "stage/denoise.glsl"
};

struct Remodulate {
  const RemodulatePush& push;
  const uint planes = push.images.at[0].denoised_count * push.images.at[0].channels;
  [[nodiscard]] uint plane_count() const { return planes; }
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
  Remodulate stage{push};
  if (push.blends != 0) {
    for (; first < end; ++first) stage.blend(first);
    return;
  }
  for (; first < end; first += square_rays) {  // chunks are of whole pixels
    float sum[15] = {};
    for (uint s = 0; s < square_rays; ++s) {
      const auto light = stage.square_light(first + s);
      for (uint p = 0; p < stage.planes; ++p) sum[p] += light.light[p];
    }
    for (uint p = 0; p < stage.planes; ++p) stage.remodulate(stage.square_pixel(first / square_rays), p, sum[p]);
  }
}

}  // namespace host
}  // namespace kuafu
