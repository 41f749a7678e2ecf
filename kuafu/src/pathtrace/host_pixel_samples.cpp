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
[[gnu::always_inline]] inline void sample_lanes(host::PixelSampleLanes& lanes, bool replicates) {
  replicates ? sample_lanes<true>(lanes) : sample_lanes<false>(lanes);
}

#ifdef __x86_64__
KUAFU_AVX2 void sample_avx2(host::PixelSampleLanes& lanes, bool replicates) { sample_lanes(lanes, replicates); }
KUAFU_AVX512 void sample_avx512(host::PixelSampleLanes& lanes, bool replicates) { sample_lanes(lanes, replicates); }
#endif

}  // namespace

namespace host {

void sample_pixels(PixelSampleLanes& lanes, bool replicates) {
#ifdef __x86_64__
  if (has_avx512()) return sample_avx512(lanes, replicates);
  if (has_avx2()) return sample_avx2(lanes, replicates);
#endif
  sample_lanes(lanes, replicates);
}

}  // namespace host
}  // namespace kuafu
