// SPDX-License-Identifier: Apache-2.0
#include "optics/optics.h"

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "frame/host_language.h"

namespace kuafu {
namespace {

#include "lib/distortion.glsl"

struct OpticsStage {
  const OpticsPush& push;
  const uint step = push.step;
#include "stage/optics.glsl"
};

/// Stage `optics`, psf, of one channel under one kernel, for a part of a row: the same sums in the same order.
void spread(const OpticsPush& push, uint32_t first, uint32_t end, std::vector<float>& padded) {
  const int row = int(first / push.width), column = int(first % push.width), count = int(end - first), width = int(push.width);
  const int in_view = row % int(push.height), last_row = int(push.height) - 1;
  const OpticsRecord& f = push.optics.at[row / int(push.height)];
  const int radius = int(f.psf_radius);
  const auto light = [&](int down) { return push.from.at + ptrdiff_t(row + down) * width; };
  if (push.step == optics_psf_columns) {
    padded.resize(size_t(count + 2 * radius));
    for (int x = -radius; x < count + radius; ++x) padded[size_t(x + radius)] = light(0)[clamp(column + x, 0, width - 1)];
  }
  float* sum = push.to.at + first;
  std::fill_n(sum, count, 0.0f);
  for (int k = -radius; k <= radius; ++k) {
    const float weight = push.kernels.at[f.psf_kernels + uint32_t(std::abs(k))];
    const float* from =
        push.step == optics_psf_columns ? &padded[size_t(k + radius)] : light(clamp(in_view + k, 0, last_row) - in_view) + column;
    for (int x = 0; x < count; ++x) sum[x] += weight * from[x];
  }
}

/// Whether pixels look where they would without a lens.
bool is_straight(const LensRecord& lens) { return lens.model == lens_straight; }

/// The same for a part of a row, whose place takes a division for all of it. Factors of a straight lens whose exponent is a usual one are
/// found by a loop that vectorises, with the same results.
void vignette(const OpticsPush& push, uint32_t first, uint32_t end, std::vector<float>& factors) {
  OpticsStage stage{push};
  const uint32_t line = first / push.width, row = line % push.height, column = first - line * push.width, count = end - first;
  const OpticsRecord& f = push.optics.at[line / push.height];
  factors.resize(count);
  const auto straight = [&](float exponent) {
    OpticsRecord g = f;
    g.vignetting_exponent = exponent;
    float* factor = factors.data();
    for (uint32_t x = 0; x < count; ++x) factor[x] = stage.vignetting_along(g, stage.straight_ray(g, column + x, row), column + x, row);
  };
  if (is_straight(f.lens) && f.vignetting_exponent == 3.0f)
    straight(3.0f);
  else if (is_straight(f.lens) && f.vignetting_exponent == 4.0f)
    straight(4.0f);
  else
    for (uint32_t x = 0; x < count; ++x) factors[x] = stage.vignetting_factor(f, column + x, row);
  float* light = push.to.at + uint64_t(first) * push.channels;
  for (uint32_t x = 0; x < count; ++x)
    for (uint32_t c = 0; c < push.channels; ++c) *light++ *= factors[x];
}

/// Whether a kernel spreads each view's light alike.
bool has_kernels(const OpticsPush& push, uint32_t first, uint32_t end) {
  if ((push.step != optics_psf_columns && push.step != optics_psf_rows) || push.channels != 1) return false;
  const uint32_t view_pixels = push.width * push.height;
  for (uint32_t view = first / view_pixels; view * view_pixels < end; ++view)
    if (push.optics.at[view].psf_kernels_per_variance != 0.0f) return false;
  return true;
}

}  // namespace

void host::optics(const OpticsPush& push, uint32_t first, uint32_t end) {
  const bool vignettes = push.step == optics_vignetting;
  if (!vignettes && !has_kernels(push, first, end)) {
    for (OpticsStage stage{push}; first < end; ++first) stage.optics(first);
    return;
  }
  std::vector<float> padded;  // or factors
  for (uint32_t next = first; next < end; first = next) {
    next = std::min(end, (first / push.width + 1) * push.width);
    if (vignettes)
      vignette(push, first, next, padded);
    else
      spread(push, first, next, padded);
  }
}

}  // namespace kuafu
