// SPDX-License-Identifier: Apache-2.0
// The check that both images show more than noise where a disparity stands, as all back ends do it.
//
// An image that shows nothing still has costs, and paths carry the disparities of things into it. What its counts vary by is the imager's
// noise, which is known. h is a count less the mean of a square about it, in 8ths of a count: brightness that varies slowly says nothing of
// disparities. At x it meets the h of the right image's column x - disparity, rounded. Over the n pixels of a window that have a disparity
// whose column is in the image, E = sum (h_l + h_r)^2 is the energy of what both show; noise has the energy N, the sum of both variances
// (energy detection: Urkowitz, Proc. IEEE 55, 1967). In noise the matcher finds disparities whose h correlate by 0.10 to 0.15, at every
// size; E / N is then DETECTION_OF_NOISE with a standard deviation of sqrt(2 / n), and a disparity stays where
//   E > N (DETECTION_OF_NOISE + least sqrt(2 / n)).
// Counts of 8 bits hide dark things that the costs still tell. Where costs tell nothing, uniqueness and the right image refuse matches: a
// window fails only if it lacks its share of them, too, half of all pixels in 31 px, 19 % in 21 px. In 15 px paths carry disparities to all
// pixels, and so they do where counts stand still, E <= N / 8. Sums are of integers; floats hold all of them exactly.
//
// What passes is a thing widened by the window and by the square of the mean. Where 3 x 3 px fail nothing is there, found or not, and the
// pixels that a thing is widened by go, too: a closing (Serra, Image Analysis and Mathematical Morphology, 1982).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "match/refine.h"
#include "shared/detection_push.h"

namespace simsense {

/// Side of the square whose mean is subtracted from a count, px; odd.
constexpr uint32_t detection_mean_side(uint32_t window) { return std::max(window > 11 ? 5u : 3u, 3 * window / 10 | 1); }

/// Distance, px, around the middle of a bare patch (3 x 3 px whose windows fail) in which all disparities go. By as much the windows widen
/// things beside it.
constexpr uint32_t detection_bare_reach(uint32_t window) { return window / 2 + detection_mean_side(window) / 2 + 1; }

/// Most pixels with a disparity in a window that fails.
constexpr uint32_t detection_most_matched(uint32_t window) {
  const uint32_t area = window * window;
  return window <= 15 ? area : area * (47 - window) / 32;
}

/// Weight of a pixel in the mean of a square of mean_side px, in 65536ths.
constexpr int32_t detection_part(uint32_t mean_side) {
  const auto area = static_cast<int32_t>(mean_side * mean_side);
  return (65536 + area / 2) / area;
}

/// Returns a count less the mean around it, in 8ths of a count. count, sum: of the pixel and of the square, in the refinement's unit; part:
/// detection_part(mean_side).
constexpr int32_t high_pass(int32_t count, int32_t sum, uint32_t mean_side, int32_t part, uint32_t extra_bits) {
  const int32_t difference = (static_cast<int32_t>(mean_side * mean_side) * count - sum) * 8 >> extra_bits;
  const int32_t h = (difference * part + 32768) >> 16;
  return h < -DETECTION_LARGEST ? -DETECTION_LARGEST : h > DETECTION_LARGEST ? DETECTION_LARGEST : h;
}

/// A pixel's share in the noise energy N, in quarters of E's unit. count: of 8 bits.
constexpr int32_t noise_energy(const DetectionNoise& noise, int32_t count) {
  const int32_t energy = (noise.dark + (noise.per_count + noise.per_count2 * count) * count) >> DETECTION_NOISE_BITS;
  return energy < noise.least ? noise.least : energy > DETECTION_MOST_NOISE ? DETECTION_MOST_NOISE : energy;
}

/// The variance of both images' counts, of 8 bits, after the mean is subtracted: dark + per_count v + per_count2 v^2, at least `least`.
DetectionNoise detection_noise(double dark, double per_count, double per_count2, double least, uint32_t mean_side);

/// The right image's column that matches column x of the left image at this disparity.
inline int32_t matched_column(int32_t x, float disparity) { return x - static_cast<int32_t>(std::floor(disparity + 0.5f)); }

/// Sums of a window: energy E, noise N in quarters of E's unit, number of pixels n.
struct DetectionSums {
  int32_t energy = 0, noise = 0, pixels = 0;
};

/// Whether the window shows more than noise, by at least `least` standard deviations, or has more than `most` matches of counts that vary.
inline bool detects(const DetectionSums& sums, float least, uint32_t most) {
  const auto noise = static_cast<float>(sums.noise), pixels = static_cast<float>(sums.pixels);
  const float expected = DETECTION_OF_NOISE * noise, excess = 4.0f * static_cast<float>(sums.energy) - expected;
  const float twice = 2.0f * least, share = twice * least, square = noise * noise;
  const bool is_matched = static_cast<uint32_t>(sums.pixels) > most && 32 * sums.energy > sums.noise;
  return is_matched || (excess > 0 && excess * excess * pixels > share * square);
}

}  // namespace simsense
