// SPDX-License-Identifier: Apache-2.0
#include "frame/host_language.h"
#include "pathtrace/host_lanes.h"

namespace kuafu {
namespace {

#include "lib/pixel_sample.glsl"

template <bool replicates>
[[gnu::always_inline]] inline void sample_lanes(host::PixelSampleLanes& lanes) {
#pragma GCC ivdep
  for (uint l = 0; l < host::lane_count; ++l) {
    const PixelSample s = pixel_sample(lanes.view_key[l], lanes.pixel[l], lanes.index[l], replicates);
    lanes.key[l] = s.key;
    lanes.index[l] = s.index;
    lanes.offset_x[l] = s.offset.x;
    lanes.offset_y[l] = s.offset.y;
  }
}

/// A choice inside the loop would keep it from being vectorised.
}  // namespace

namespace host {

void sample_pixels(PixelSampleLanes& lanes, bool replicates) {
  if (replicates)
    in_vectors([&] { sample_lanes<true>(lanes); });
  else
    in_vectors([&] { sample_lanes<false>(lanes); });
}

}  // namespace host
}  // namespace kuafu
