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
#include "lib/splat_table.glsl"

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

struct TableOfSplats {
  const SplatTablePush& push;
#include "stage/splat_table.glsl"
};

}  // namespace

namespace host {

/// As Generate::start_path does for each slot, plane after plane.
static void start_paths(const GeneratePush& push, const PixelSampleLanes& lanes, const Pixel* pixels, uint32_t first, uint32_t count) {
  const auto plane = [&](uint32_t p) { return push.state.at + p * push.range.capacity + first; };
  std::copy_n(lanes.key, count, plane(state_pixel_key));
  std::copy_n(lanes.index, count, plane(state_sample));
  for (uint32_t l = 0; l < count; ++l) plane(state_flags)[l] = push.views.at[pixels[l].view].environment | path_all_delta;
  uint32_t p = state_throughput;
  for (; p < state_radiance(push.channels); ++p) std::fill_n(plane(p), count, floatBitsToUint(1.0f));
  for (; p < state_shadow(push.channels, push.groups); ++p) std::fill_n(plane(p), count, 0u);
}

void generate(const GeneratePush& push, uint32_t first, uint32_t end) {
  Generate stage{push};
  PixelSampleLanes lanes{};
  Pixel pixels[lane_count];
  for (; first < end; first += lane_count) {
    const uint32_t count = std::min(lane_count, end - first);
    uint32_t sample = 0;
    for (uint32_t l = 0; l < count; ++l) {
      const bool same = l > 0 && ++sample < push.range.first_sample + push.range.sample_count;  // a pixel's samples stand together
      pixels[l] = same ? pixels[l - 1] : stage.slot_pixel(first + l, sample);
      lanes.index[l] = sample;
      lanes.view_key[l] = push.views.at[pixels[l].view].key;
      lanes.pixel[l] = stage.pixel_word(pixels[l]);
    }
    if (!stage.through_centres()) sample_pixels(lanes, stage.in_replicates());
    for (uint32_t l = 0; l < count; ++l)
      stage.start_ray(first + l, pixels[l], lanes.key[l], lanes.index[l], {lanes.offset_x[l], lanes.offset_y[l]});
    if (stage.starts_paths()) start_paths(push, lanes, pixels, first, count);
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

void splat_table(const SplatTablePush& push, uint32_t first, uint32_t end) {
  for (TableOfSplats stage{push}; first < end; ++first) stage.table_step(first);
}

}  // namespace host
}  // namespace kuafu
