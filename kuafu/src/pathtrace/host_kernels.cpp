// SPDX-License-Identifier: Apache-2.0
#include "pathtrace/host_kernels.h"

#include <algorithm>

#include "frame/host_language.h"
#include "pathtrace/host_lanes.h"

#define KUAFU_CHANNELS 3
namespace kuafu {
namespace {

constexpr uint features = feature_camera | feature_motion | feature_lookups;
#include "lib/camera.glsl"
#include "lib/pixel_sample.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

struct Generate {
  const GeneratePush& push;
#include "stage/generate.glsl"
};

struct Resolve {
  const ResolvePush& push;
#include "stage/resolve.glsl"
};

struct Accumulate {
  const AccumulatePush& push;
#include "stage/accumulate.glsl"
};

struct Visibility {
  const AovPush& push;
#include "stage/visibility.glsl"
};

}  // namespace

namespace host {

void generate(const GeneratePush& push, uint32_t first, uint32_t end) {
  Generate stage{push};
  PixelSampleLanes lanes{};
  Pixel pixels[lane_count];
  for (; first < end; first += lane_count) {
    const uint32_t count = std::min(lane_count, end - first);
    for (uint32_t l = 0; l < count; ++l) {
      pixels[l] = stage.slot_pixel(first + l, lanes.index[l]);
      lanes.view_key[l] = push.views.at[pixels[l].view].key;
      lanes.pixel[l] = stage.pixel_word(pixels[l]);
    }
    if (!stage.through_centres()) sample_pixels(lanes, stage.in_replicates());
    for (uint32_t l = 0; l < count; ++l)
      stage.start_path(first + l, pixels[l], lanes.key[l], lanes.index[l], {lanes.offset_x[l], lanes.offset_y[l]});
  }
}

void resolve(const ResolvePush& push, uint32_t first, uint32_t end) {
  for (Resolve stage{push}; first < end; ++first) stage.resolve(first);
}

void accumulate(const AccumulatePush& push, uint32_t first, uint32_t end) {
  for (Accumulate stage{push}; first < end; ++first) stage.accumulate(first);
}

void visibility(const AovPush& push, uint32_t first, uint32_t end) {
  for (Visibility stage{push}; first < end; ++first) stage.visibility(first);
}

}  // namespace host
}  // namespace kuafu
