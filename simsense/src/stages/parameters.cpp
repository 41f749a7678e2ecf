// SPDX-License-Identifier: Apache-2.0
#include "stages/settings.h"

#include <algorithm>
#include <cmath>

#include "device/error.h"
#include "parameters/fields.h"

namespace simsense {
namespace {

/// Both sides odd, with at most max_product cells (and at least min_product).
void check_window(uint32_t width, uint32_t height, uint64_t min_product, uint64_t max_product, const char* name) {
  const uint64_t product = uint64_t{width} * height;
  if (width % 2 == 0 || height % 2 == 0 || product < min_product || product > max_product)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is %ux%u: both sides must be odd and their product %llu..%llu", name, width, height,
             static_cast<unsigned long long>(min_product), static_cast<unsigned long long>(max_product));
}

void check_penalties(const simsense_parameters& p) {
  if (!(0 < p.p1 && p.p1 < p.p2 && p.p2 < 224))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "p1 is %u, p2 is %u: must be 0 < p1 < p2 < 224", p.p1, p.p2);
  const uint32_t largest_cost = match_parameters(p).block_area() * (match_parameters(p).census_bits() + p.p2);
  if (largest_cost > 65535)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "block area times census bits plus p2 is %u: must be at most 65535 to fit 16 bits", largest_cost);
}

}  // namespace

void check_parameters(const simsense_parameters& p) {
  check_fields(p, "");
  check_window(p.census_width, p.census_height, 3, p.census_kind == SIMSENSE_CENSUS_PLAIN ? 63 : 65, "census window");
  check_window(p.block_width, p.block_height, 1, 256, "block");
  check_penalties(p);
  if (!(p.max_depth_m > p.min_depth_m))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "max_depth_m is %g, min_depth_m is %g: the maximum must be larger", p.max_depth_m, p.min_depth_m);
}

void check_region(const simsense_parameters& p, uint32_t width, uint32_t height) {
  if (p.roi_width == 0 && p.roi_height == 0) return;
  const auto inside = [](uint32_t begin, uint32_t length, uint32_t size) { return length > 0 && begin < size && length <= size - begin; };
  if (!inside(p.roi_x, p.roi_width, width) || !inside(p.roi_y, p.roi_height, height))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "roi is %ux%u at %u,%u: must lie in the image of %ux%u pixels, or have size 0x0 for all of it",
             p.roi_width, p.roi_height, p.roi_x, p.roi_y, width, height);
}

MatchParameters match_parameters(const simsense_parameters& p) {
  MatchParameters m{match_fields(p)};
  m.census_kind = static_cast<CensusKind>(p.census_kind);
  m.census_contrast_256ths = std::min(255u, static_cast<uint32_t>(std::lround(p.census_contrast * 256.0f)));
  m.subpixel = static_cast<Subpixel>(p.subpixel);
  return m;
}

DepthRange depth_range(const simsense_parameters& p) { return {p.min_depth_m, p.max_depth_m}; }

}  // namespace simsense
