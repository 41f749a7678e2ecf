#include "parameters.h"

#include <cmath>

#include "device/error.h"

namespace simsense {
namespace {

void check_not_negative(float value, const char* name) {
  if (!(value >= 0) || std::isinf(value)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is %g: must be finite and >= 0", name, value);
}

/// Both sides odd, with at most max_product cells (and at least min_product).
void check_window(uint32_t width, uint32_t height, uint64_t min_product, uint64_t max_product, const char* name) {
  const uint64_t product = uint64_t{width} * height;
  if (width % 2 == 0 || height % 2 == 0 || product < min_product || product > max_product)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is %ux%u: both sides must be odd and their product %llu..%llu", name, width, height,
             static_cast<unsigned long long>(min_product), static_cast<unsigned long long>(max_product));
}

void check_matching(const simsense_parameters& p) {
  check_window(p.census_width, p.census_height, 3, 65, "census window");
  if (p.max_disparity < 16 || p.max_disparity > 1024)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "max_disparity is %u: must be 16..1024", p.max_disparity);
  check_window(p.block_width, p.block_height, 1, 256, "block");
  if (!(0 < p.p1 && p.p1 < p.p2 && p.p2 < 224))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "p1 is %u, p2 is %u: must be 0 < p1 < p2 < 224", p.p1, p.p2);
  if (p.uniqueness_ratio > 100) ks::fail(KS_ERROR_INVALID_ARGUMENT, "uniqueness_ratio is %u percent: must be 0..100", p.uniqueness_ratio);
  if (p.lr_max_diff < -1 || p.lr_max_diff > 1024)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "lr_max_diff is %d pixels: must be 0..1024, or -1 for off", p.lr_max_diff);
  if (p.median_size != 1 && p.median_size != 3 && p.median_size != 5 && p.median_size != 7)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "median_size is %u: must be 1 (off), 3, 5 or 7", p.median_size);
  if (p.subpixel > SIMSENSE_SUBPIXEL_EQUIANGULAR)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "subpixel is %u: must be a SIMSENSE_SUBPIXEL_*, none (0), parabola (1) or equiangular (2)",
             p.subpixel);
}

}  // namespace

void check_parameters(const simsense_parameters& p) {
  check_matching(p);
  check_not_negative(p.min_depth_m, "min_depth_m");
  if (!(p.max_depth_m > p.min_depth_m))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "max_depth_m is %g, min_depth_m is %g: the maximum must be larger", p.max_depth_m, p.min_depth_m);
}

MatchParameters match_parameters(const simsense_parameters& p) {
  MatchParameters m;
  m.census_width = p.census_width;
  m.census_height = p.census_height;
  m.max_disparity = p.max_disparity;
  m.block_width = p.block_width;
  m.block_height = p.block_height;
  m.p1 = p.p1;
  m.p2 = p.p2;
  m.uniqueness_ratio = p.uniqueness_ratio;
  m.lr_max_diff = p.lr_max_diff;
  m.median_size = p.median_size;
  m.subpixel = p.subpixel == SIMSENSE_SUBPIXEL_NONE       ? Subpixel::none
               : p.subpixel == SIMSENSE_SUBPIXEL_PARABOLA ? Subpixel::parabola
                                                          : Subpixel::equiangular;
  return m;
}

DepthRange depth_range(const simsense_parameters& p) { return {p.min_depth_m, p.max_depth_m}; }

}  // namespace simsense
