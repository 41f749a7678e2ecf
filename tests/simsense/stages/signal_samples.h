// The imager as its tests use it: flat fields and plain statistics.
#pragma once

#include <cmath>
#include <vector>

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

/// Counts of an image of floats.
inline std::vector<double> measure(const simsense_signal& signal, const simsense::NoiseKey& key, const std::vector<float>& input,
                                   uint32_t width = field_width, uint32_t height = field_height, unsigned worker_count = 2) {
  ks::ThreadPool workers(worker_count);
  const simsense::Imager imager(signal);
  std::vector<uint16_t> counts(size_t{width} * height);
  imager.measure(key, packed(input, width, KS_FORMAT_F32), width, height, counts.data(), workers);
  return {counts.begin(), counts.end()};
}

/// Counts of a field of equal light.
inline std::vector<double> flat(const simsense_signal& signal, float light, const simsense::NoiseKey& key = {}) {
  return measure(signal, key, std::vector<float>(static_cast<size_t>(field_pixels), light));
}

/// 16 bits whose count is 1 / `counts_per_unit` of what the stages work in, above a pedestal, so that neither steps nor the range's ends
/// show.
inline simsense_signal fine_signal(float counts_per_unit, float black_dn = 1000) {
  simsense_signal s = simsense_signal_init();
  s.bit_depth = 16;
  s.gain = counts_per_unit;
  s.black_level_dn = black_dn;
  return s;
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

inline std::vector<double> mean_of(const std::vector<std::vector<double>>& frames) {
  std::vector<double> mean(frames[0].size());
  for (const auto& frame : frames)
    for (size_t i = 0; i < mean.size(); ++i) mean[i] += frame[i] / static_cast<double>(frames.size());
  return mean;
}

}  // namespace simsense_test
