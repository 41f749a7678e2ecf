// Film samples of many paths at once, one path per lane of the machine's vectors; the text is the shaders' own (lib/pixel_sample.glsl).
// Thread rule: any thread, each with its own lanes.
#pragma once

#include <cstdint>

namespace kuafu::host {

constexpr uint32_t pixel_sample_lanes = 32;

/// Lanes that no path is in may hold anything.
struct alignas(64) PixelSampleLanes {
  template <class T>
  using Lanes = T[pixel_sample_lanes];

  Lanes<uint32_t> view_key, pixel;
  Lanes<uint32_t> index;  // in: of the pixel's samples; out: in the path's sequence
  Lanes<uint32_t> key;    // from here on as PixelSample
  Lanes<float> offset_x, offset_y;
};

/// The widest vectors that the machine has; results do not depend on them.
void sample_pixels(PixelSampleLanes& lanes, bool replicates);

}  // namespace kuafu::host
