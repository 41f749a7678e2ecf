// SPDX-License-Identifier: Apache-2.0
// The imager as its tests use it: flat fields and plain statistics.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cpu/signal/imager.h"
#include "device/thread_pool.h"
#include "ks/image.h"
#include "signal/imager.h"

namespace simsense_test {

constexpr uint32_t field_width = 512, field_height = 384;
constexpr double field_pixels = double{field_width} * field_height;

template <class T>
simsense::ConstPlane packed(const std::vector<T>& image, uint32_t width, uint32_t format) {
  return {reinterpret_cast<const std::byte*>(image.data()), static_cast<ptrdiff_t>(width * sizeof(T)), sizeof(T), format};
}

/// Counts of an image of floats. laser: the part of it that has speckle; without one, all has.
inline std::vector<double> measure(const simsense_signal& signal, const simsense::NoiseKey& key, const std::vector<float>& input,
                                   uint32_t width = field_width, uint32_t height = field_height, unsigned worker_count = 2,
                                   const std::vector<float>* laser = nullptr) {
  ks::ThreadPool workers(worker_count);
  const simsense::Imager imager(signal);
  std::vector<uint16_t> counts(size_t{width} * height);
  simsense::cpu::Irradiance light{packed(input, width, KS_FORMAT_F32), std::nullopt};
  if (laser) light.laser = packed(*laser, width, KS_FORMAT_F32);
  simsense::cpu::measure(imager, key, light, width, height, counts.data(), workers);
  return {counts.begin(), counts.end()};
}

/// Counts of a field of equal light.
inline std::vector<double> flat(const simsense_signal& signal, float light, const simsense::NoiseKey& key = {}) {
  return measure(signal, key, std::vector<float>(static_cast<size_t>(field_pixels), light));
}

/// 16 bits of 1 / `counts_per_unit` of what the stages work in, above a pedestal: neither steps nor the range's ends show.
inline simsense_signal fine_signal(float counts_per_unit, float black_dn = 1000) {
  simsense_signal s = simsense_signal_init();
  s.bit_depth = 16;
  s.gain = counts_per_unit;
  s.black_level_dn = black_dn;
  return s;
}

/// Each stage alone, and all of them; every one does something to an image of 0..250.
inline std::vector<std::pair<const char*, simsense_signal>> every_stage() {
  std::vector<std::pair<const char*, simsense_signal>> all;
  const auto add = [&](const char* name, auto&& change) {
    simsense_signal s = simsense_signal_init();
    change(s);
    all.emplace_back(name, s);
  };
  add("exposure", [](simsense_signal& s) { s.exposure_s = 0.01f, s.responsivity_e = 77.13f; });
  add("temporal speckle", [](simsense_signal& s) { s.speckle_shape = 3.98f, s.speckle_scale = 0.254f; });
  add("static speckle", [](simsense_signal& s) { s.speckle_shape = 0.6f, s.speckle_scale = 1.6f, s.speckle_correlation = 1; });
  add("partly static speckle", [](simsense_signal& s) { s.speckle_shape = 20, s.speckle_scale = 0.05f, s.speckle_correlation = 0.3f; });
  add("grainy speckle", [](simsense_signal& s) { s.speckle_shape = 4, s.speckle_scale = 0.25f, s.speckle_psf_sigma_px = 0.8f; });
  add("prnu", [](simsense_signal& s) { s.prnu = 0.05f; });
  add("dark", [](simsense_signal& s) { s.dark_current_e_per_s = 7, s.temperature_c = 45; });
  add("hot pixels", [](simsense_signal& s) { s.hot_pixel_share = 0.01f, s.hot_pixel_e_per_s = 100; });
  add("shot noise", [](simsense_signal& s) { s.shot_noise = 1; });
  add("weaker shot noise", [](simsense_signal& s) { s.shot_noise = 0.4f, s.responsivity_e = 30, s.conversion_gain_dn_per_e = 1.0f / 30; });
  add("full well", [](simsense_signal& s) { s.full_well_e = 150.5f; });
  add("blooming", [](simsense_signal& s) { s.full_well_e = 150.3f, s.blooming = 0.7f; });
  add("fixed patterns", [](simsense_signal& s) { s.dsnu_e = 2, s.row_fixed_e = 3, s.column_fixed_e = 4; });
  add("temporal noise", [](simsense_signal& s) { s.read_noise_e = 2, s.row_noise_e = 3, s.column_noise_e = 4; });
  add("response", [](simsense_signal& s) { s.response_exponent = 0.45f; });
  add("converter",
      [](simsense_signal& s) { s.adc_noise_dn = 0.8f, s.black_level_dn = 5.3f, s.black_level_dn_per_k = 0.1f, s.temperature_c = 33; });
  add("ten bits", [](simsense_signal& s) { s.bit_depth = 10, s.gain = 3.9137f; });
  for (const char* preset : {"paper-d415", "sapien", "d435"}) all.emplace_back(preset, simsense::signal_preset(preset));
  simsense_signal everything = simsense::signal_preset("d435");
  everything.speckle_shape = 50, everything.speckle_scale = 0.02f, everything.speckle_correlation = 0.5f, everything.prnu = 0.01f;
  everything.dark_current_e_per_s = 50, everything.hot_pixel_share = 0.002f, everything.hot_pixel_e_per_s = 9000,
  everything.temperature_c = 50;
  everything.full_well_e = 40000, everything.blooming = 0.5f, everything.dsnu_e = everything.row_fixed_e = everything.column_noise_e = 20;
  everything.read_noise_e = 30, everything.response_exponent = 0.9f, everything.black_level_dn = 8, everything.bit_depth = 12,
  everything.gain = 16;
  all.emplace_back("everything", everything);
  return all;
}

inline std::vector<float> ramp(size_t pixels) {
  std::vector<float> image(pixels);
  for (size_t i = 0; i < pixels; ++i) image[i] = static_cast<float>((i * 37) % 251);
  return image;
}

/// A third of the light, more than all of it, none.
inline std::vector<float> laser_part(std::vector<float> light) {
  for (size_t i = 0; i < light.size(); ++i) light[i] *= i % 3 == 0 ? 1.0f / 3 : i % 3 == 1 ? 1.5f : 0.0f;
  return light;
}

/// Float against double: a count changes where a value lies within rounding of a half, or a Poisson expansion misses by an electron.
inline void expect_equal_but_for_rounding(const std::vector<double>& found, const std::vector<uint16_t>& exact, const char* name) {
  size_t different = 0;
  double worst = 0;
  for (size_t i = 0; i < found.size(); ++i) {
    different += found[i] != exact[i];
    worst = std::max(worst, std::abs(found[i] - exact[i]));
  }
  EXPECT_LE(worst, 1) << name;
  EXPECT_LE(static_cast<double>(different), 1e-3 * static_cast<double>(found.size())) << name;
}

inline const float infinite = std::numeric_limits<float>::infinity();
inline const std::vector<float> wild{-infinite, -1e38f, -1, 0, 1e-40f, 1e38f, infinite, std::numeric_limits<float>::quiet_NaN()};

/// Counts of `wild` under a signal of every_stage().
inline void expect_in_range(const std::vector<double>& counts, const char* name, const simsense_signal& signal) {
  const double full = std::pow(2.0, signal.bit_depth) - 1;
  EXPECT_LE(counts[0], 0.2 * full) << name;
  EXPECT_LE(counts[7], 0.2 * full) << name;
  if (signal.full_well_e == 0) {
    EXPECT_EQ(counts[6], full) << name;
  }
}

struct Moments {
  double mean = 0, variance = 0, skewness = 0, kurtosis = 0;
};

inline Moments moments(const std::vector<double>& values) {
  Moments m;
  const double n = static_cast<double>(values.size());
  for (double v : values) m.mean += v / n;
  double third = 0, fourth = 0;
  for (double v : values) {
    const double d = v - m.mean;
    m.variance += d * d / n;
    third += d * d * d / n;
    fourth += d * d * d * d / n;
  }
  m.skewness = third / std::pow(m.variance, 1.5);
  m.kurtosis = fourth / (m.variance * m.variance);
  return m;
}

inline double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const Moments ma = moments(a), mb = moments(b);
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - ma.mean) * (b[i] - mb.mean);
  return sum / (static_cast<double>(a.size()) * std::sqrt(ma.variance * mb.variance));
}

/// Five standard errors of a correlation of independent fields.
inline const double correlation_limit = 5 / std::sqrt(field_pixels);

}  // namespace simsense_test
