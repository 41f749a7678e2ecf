#include "parameters/parameters.h"

#include <algorithm>
#include <cmath>
#include <iterator>

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

void check_choice(uint32_t value, uint32_t last, const char* name, const char* choices) {
  if (value > last) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is %u: must be one of %s", name, value, choices);
}

void check_matching(const simsense_parameters& p) {
  check_choice(p.census_kind, SIMSENSE_CENSUS_PLAIN, "census_kind", "center_symmetric (0), plain (1)");
  check_window(p.census_width, p.census_height, 3, p.census_kind == SIMSENSE_CENSUS_PLAIN ? 63 : 65, "census window");
  if (!(p.census_contrast >= 0 && p.census_contrast <= 1))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "census_contrast is %g: must be 0 (off) to 1", p.census_contrast);
  if (p.max_disparity < 16 || p.max_disparity > 1024)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "max_disparity is %u: must be 16..1024", p.max_disparity);
  if (p.min_disparity < -1024 || p.min_disparity > 4096)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "min_disparity is %d: must be -1024..4096", p.min_disparity);
  check_window(p.block_width, p.block_height, 1, 256, "block");
  if (p.path_count != 0 && p.path_count != 4 && p.path_count != 8)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "path_count is %u: must be 4 or 8 (0 means 4)", p.path_count);
  if (!(0 < p.p1 && p.p1 < p.p2 && p.p2 < 224))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "p1 is %u, p2 is %u: must be 0 < p1 < p2 < 224", p.p1, p.p2);
  const uint32_t largest_cost = match_parameters(p).block_area() * (match_parameters(p).census_bits() + p.p2);
  if (largest_cost > 65535)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "block area times census bits plus p2 is %u: must be at most 65535 to fit 16 bits", largest_cost);
  if (p.uniqueness_ratio > 100) ks::fail(KS_ERROR_INVALID_ARGUMENT, "uniqueness_ratio is %u percent: must be 0..100", p.uniqueness_ratio);
  if (p.lr_max_diff < -1 || p.lr_max_diff > 1024)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "lr_max_diff is %d pixels: must be 0..1024, or -1 for off", p.lr_max_diff);
  if (p.median_size != 1 && p.median_size != 3 && p.median_size != 5 && p.median_size != 7)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "median_size is %u: must be 1 (off), 3, 5 or 7", p.median_size);
  check_choice(p.subpixel, SIMSENSE_SUBPIXEL_EQUIANGULAR_SUMMED, "subpixel",
               "none (0), parabola (1), equiangular (2), equiangular_summed (3)");
  check_not_negative(p.speckle_max_diff_px, "speckle_max_diff_px");
  check_choice(p.hole_filling, SIMSENSE_HOLES_BACKGROUND, "hole_filling", "keep (0), left (1), background (2)");
}

}  // namespace

void check_parameters(const simsense_parameters& p) {
  check_matching(p);
  check_not_negative(p.min_depth_m, "min_depth_m");
  if (!(p.max_depth_m > p.min_depth_m))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "max_depth_m is %g, min_depth_m is %g: the maximum must be larger", p.max_depth_m, p.min_depth_m);
  if (p.splat_size > 15) ks::fail(KS_ERROR_INVALID_ARGUMENT, "splat_size is %u pixels: must be 0..15", p.splat_size);
}

void check_region(const simsense_parameters& p, uint32_t width, uint32_t height) {
  if (p.roi_width == 0 && p.roi_height == 0) return;
  const auto inside = [](uint32_t begin, uint32_t length, uint32_t size) { return length > 0 && begin < size && length <= size - begin; };
  if (!inside(p.roi_x, p.roi_width, width) || !inside(p.roi_y, p.roi_height, height))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "roi is %ux%u at %u,%u: must lie in the image of %ux%u pixels, or have size 0x0 for all of it",
             p.roi_width, p.roi_height, p.roi_x, p.roi_y, width, height);
}

MatchParameters match_parameters(const simsense_parameters& p) {
  MatchParameters m;
  m.census = p.census_kind == SIMSENSE_CENSUS_PLAIN ? CensusKind::plain : CensusKind::center_symmetric;
  m.census_width = p.census_width;
  m.census_height = p.census_height;
  m.census_contrast = std::min(255u, static_cast<uint32_t>(std::lround(p.census_contrast * 256.0f)));
  m.max_disparity = p.max_disparity;
  m.min_disparity = p.min_disparity;
  m.path_count = p.path_count == 8 ? 8 : 4;
  m.p2_full_gradient = p.p2_full_gradient_dn;
  m.block_width = p.block_width;
  m.block_height = p.block_height;
  m.p1 = p.p1;
  m.p2 = p.p2;
  m.uniqueness_ratio = p.uniqueness_ratio;
  m.lr_max_diff = p.lr_max_diff;
  m.median_size = p.median_size;
  constexpr Subpixel steps[] = {Subpixel::none, Subpixel::parabola, Subpixel::equiangular, Subpixel::equiangular_summed};
  m.subpixel = steps[std::min<size_t>(p.subpixel, std::size(steps) - 1)];
  return m;
}

DepthRange depth_range(const simsense_parameters& p) { return {p.min_depth_m, p.max_depth_m}; }

}  // namespace simsense
