// SPDX-License-Identifier: Apache-2.0
// The steps of the matcher one after the other, slow and plain, on arrays of pixels and of disparities.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "match/matcher.h"

namespace simsense::reference {

// Plain arrays of the scalar reference: an image of per-pixel values, and a volume with one value per pixel and disparity.
template <class T>
struct Grid {
  size_t width = 0, height = 0;
  std::vector<T> data;  // [height][width]
  Grid(size_t w, size_t h, T fill = T{}) : width(w), height(h), data(w * h, fill) {}
  T& at(size_t x, size_t y) { return data[y * width + x]; }
  [[nodiscard]] const T& at(size_t x, size_t y) const { return data[y * width + x]; }
};

template <class T>
struct Volume {
  size_t width = 0, height = 0, disparities = 0;
  std::vector<T> data;  // [height][width][disparities]
  Volume(size_t w, size_t h, size_t d) : width(w), height(h), disparities(d), data(w * h * d) {}
  T* at(size_t x, size_t y) { return &data[(y * width + x) * disparities]; }
  [[nodiscard]] const T* at(size_t x, size_t y) const { return &data[(y * width + x) * disparities]; }
};

// Census words. Plain (Zabih and Woodfill 1994, "Non-parametric local transforms for computing visual correspondence"): each pixel of the
// window is compared with the centre. Center-symmetric (Spangenberg et al. 2013, "Weighted semi-global matching and center-symmetric census
// transform"): each pixel of the window is compared with its mirror through the centre, which makes half the bits of the plain census carry
// the same structure. The threshold on the difference is that of center-symmetric local binary patterns (Heikkilä, Pietikäinen and Schmid
// 2009, "Description of interest regions with local binary patterns"), here a share of the local contrast.
/// Center-symmetric: one bit per mirrored pair, (census_width * census_height - 1) / 2 of them: 1 where the pixel that comes first in
/// raster order is >= its mirror. Plain: one bit per pixel but the centre, in raster order: 1 where it is < the centre. Pixels outside the
/// image are 0.
/// census_contrast_256ths > 0: pixels outside the image are the nearest one inside. A bit needs a difference of more than
/// census_contrast_256ths / 256 of the range of counts in the window and contrast_margin around it, and of more than census_noise_dn
/// counts, so that noise between dots and on dark surfaces sets none. Plain: 1 where the pixel is that much below the centre.
/// Center-symmetric: 1 where the first pixel is that much above its mirror in the even pairs, and where the mirror is above the first in
/// the odd ones: with one direction alone a lone dot would be seen in half of the window.
Grid<uint64_t> census(ConstImage image, size_t width, size_t height, const MatchParameters& parameters);

// Matching cost: Hamming distance of census words, and its sum over a block.
/// cost(x, y, d) = number of bits that differ between left (x, y) and right (x - min_disparity - d, y), the nearest column where there is
/// none.
Volume<uint16_t> hamming_cost(const Grid<uint64_t>& left, const Grid<uint64_t>& right, size_t disparities, int32_t min_disparity = 0);

/// Sum over the block centred at each pixel, per disparity; pixels outside the image take the cost of the nearest one inside.
Volume<uint16_t> block_sum(const Volume<uint16_t>& cost, size_t block_width, size_t block_height);

// Semi-global aggregation (Hirschmüller 2008, "Stereo processing by semiglobal matching and mutual information", eq. 13).
/// The penalty of a disparity jump between two neighbouring pixels: p2, or less across an edge of the image (the same paper: P2 falls with
/// the gradient, and never below P1): p2 * full_gradient / gradient where the grey levels differ by more than full_gradient.
struct JumpPenalty {
  uint32_t p1 = 0, p2 = 0;
  uint32_t full_gradient = 0;  // 0: p2 everywhere, and no image is needed
  ConstImage image{};
  [[nodiscard]] uint32_t between(ptrdiff_t x, ptrdiff_t y, ptrdiff_t other_x, ptrdiff_t other_y) const;
};

/// L_r(p, d) = C(p, d) + min(L_r(p-r, d), L_r(p-r, d-1) + p1, L_r(p-r, d+1) + p1, min_k L_r(p-r, k) + p2) - min_k L_r(p-r, k),
/// for r = right, left, down, up, and of 8 the diagonals too; L_r = C where the path enters the image. The penalties count `block_area`
/// times. Returns the sum over the paths divided by their number, rounded down.
Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, const JumpPenalty& penalty, uint32_t block_area, uint32_t path_count);
/// Four paths with the same penalties everywhere.
Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, uint32_t p1, uint32_t p2);

// From the aggregated volume to disparities: winner, uniqueness, subpixel step, confidence.
/// Disparity of lowest cost in the left image, the smaller one on a tie; -1 where some d with |d - winner| > 1 has
/// cost * (100 - uniqueness_ratio) < winner's cost * 100. The subpixel step needs both neighbours: none at d = 0 and d = D - 1, and none
/// where the costs are equal. block_cost: what the equiangular step looks at, the sums before aggregation; nullptr = the aggregated costs.
Grid<float> left_winner(const Volume<uint16_t>& cost, uint32_t uniqueness_ratio, Subpixel subpixel, const Volume<uint16_t>* block_cost);

/// 1 - c1 / c2, with c1 the lowest cost and c2 the lowest of a disparity that is no neighbour of c1's; 0 if c2 is 0. The ratio c2 / c1 is
/// the peak ratio of Hu and Mordohai 2012 ("A quantitative evaluation of confidence measures for stereo vision", PKR). A pixel is unique by
/// ratio r where this is >= r percent.
Grid<float> confidence(const Volume<uint16_t>& cost);

/// Disparity of lowest cost as seen from the right pixel (x, y): over the left pixels (x + min_disparity + d, y) inside the image, at d;
/// the smaller one on a tie. Disparities here and below count from min_disparity.
Grid<uint32_t> right_winner(const Volume<uint16_t>& cost, int32_t min_disparity = 0);

// What follows from the winners: left-right check and median.
/// -1 where the left disparity, rounded, points outside the right image or differs by more than max_diff from the right disparity there.
/// reason: if given, outside and occluded are noted.
Grid<float> left_right_check(const Grid<float>& left, const Grid<uint32_t>& right, int32_t max_diff, int32_t min_disparity = 0,
                             Grid<MatchReason>* reason = nullptr);

/// Median of size x size values, invalid ones (-1) included; pixels nearer than size / 2 to the border are copied.
Grid<float> median(const Grid<float>& disparity, size_t size);

// The refinement of a disparity map by the images' counts (match/refine.h), slow and plain.
/// disparity: after the median, with min_disparity added; p.invalid_disparity() = none, which stays so.
Grid<float> refine(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p);

// The check that both images show more than noise (match/detection.h), slow and plain.
/// Whether each pixel's disparity stays; p.invalid_disparity() = none, of which nothing is asked.
Grid<uint8_t> detects(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p,
                      const DetectionNoise& noise);

}  // namespace simsense::reference
