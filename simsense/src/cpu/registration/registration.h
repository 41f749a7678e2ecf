// SPDX-License-Identifier: Apache-2.0
// Registration: depth of the rectified left camera seen from the RGB camera. Each measured pixel is a point that lands on the nearest RGB
// pixel; the nearest point wins. The z-buffer is a minimum, so the result does not depend on order or on the number of workers.
// Thread rule: externally synchronised (it owns its z-buffer).
#pragma once

#include <array>
#include <vector>

#include "depth/depth.h"
#include "device/thread_pool.h"
#include "registration/projection.h"

namespace simsense {

class Registration {
 public:
  /// width, height: of the left camera. projection must outlive this.
  Registration(const RgbProjection& projection, uint32_t width, uint32_t height)
      : projection_(projection),
        width_(width),
        height_(height),
        nearest_(size_t{projection.width() + 2 * SPLAT_MARGIN} * (projection.height() + 2 * SPLAT_MARGIN)) {}

  /// Projects a depth image into the RGB camera. depth: packed [height][width] of the rectified left camera. out: packed
  /// [rgb.height][rgb.width], z in the RGB camera, metres, 0 = no point.
  void apply(const float* depth, const DepthRange& range, Splat splat, float* out, ks::ThreadPool& workers);

 private:
  static constexpr size_t chunk = 256;
  /// The z-buffer cell of each point of a chunk; -1 for points outside.
  struct Landings {
    std::array<int32_t, chunk> cell;
    std::array<float, chunk> z;
  };
  void splat_row(const float* depth, uint32_t y);
  void project(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const;
  void project_unrectified(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const;
  void keep_nearest(const Landings& landings, size_t count);
  /// The z-buffer's size, copied so that loops over pixels keep it in registers.
  struct Cells {
    float margin, width, height;
    int32_t pitch;
    [[nodiscard]] int32_t at(float column, float row, bool seen) const;
  };
  [[nodiscard]] Cells cells() const;
  [[nodiscard]] size_t pitch() const { return projection_.width() + 2 * SPLAT_MARGIN; }
  void resolve_row(const DepthRange& range, Splat splat, uint32_t y, int32_t* scratch, float* out) const;

  const RgbProjection& projection_;
  uint32_t width_, height_;
  std::vector<int32_t> nearest_;  // the image and SPLAT_MARGIN around it; bits of a positive float sort as the float does
};

}  // namespace simsense
