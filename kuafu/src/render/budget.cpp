// SPDX-License-Identifier: Apache-2.0
#include "render/render_run.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "shared/wave.h"

namespace kuafu {
namespace {

constexpr uint32_t least_paths = 4096;  // in a first round: bright and rare paths must have had their chance also in an image of few pixels

}  // namespace

Budget::Budget(uint32_t samples, uint32_t pixels, double max_seconds, double relative_error)
    : samples_(samples), next_(samples), max_seconds_(max_seconds), relative_error_(relative_error) {
  if (relative_error > 0)
    next_ =
        std::min(samples, std::max(2 * replicate_count, (least_paths / pixels + replicate_count - 1) / replicate_count * replicate_count));
  else if (max_seconds > 0)
    next_ = 1;
}

void Budget::round_done(double seconds, uint32_t all_samples, double relative_error) {
  done_ += next_;
  const double per_sample_s = (seconds - seconds_) / next_;
  seconds_ = seconds;
  const double step = relative_error_ > 0 ? replicate_count : 1;  // whole replicates keep the estimate unbiased
  double more = done_;                                            // doubles
  if (relative_error_ > 0 && std::isfinite(relative_error)) {
    // The error falls at least with the root of the samples. A tenth is added, so that the last round seldom falls short.
    const double missing = 1.1 * all_samples * (std::pow(relative_error / relative_error_, 2) - 1);
    more = relative_error <= relative_error_ ? 0 : std::min(more, std::ceil(missing / step) * step);
  }
  if (max_seconds_ > 0) more = std::min(more, std::floor(std::max(0.0, max_seconds_ - seconds) / (per_sample_s * step)) * step);
  next_ = uint32_t(std::min<double>(more, samples_ - done_));
}

namespace {

constexpr double z_confidence = 1.0;  // standard deviations, one-sided: 84 %

/// The image where it lies if the host can see it, else a copy.
const float* values_of(const ks::Buffer& image, uint64_t count, std::vector<float>& copy) {
  if (const auto* values = static_cast<const float*>(image.mapped())) return values;
  copy.resize(count);
  image.read(0, copy.data(), count * sizeof(float));
  return copy.data();
}

/// The true mean of estimated variances may be so many times as large as the mean of the estimates, if that scatters like a chi-square of
/// so many degrees of freedom (lower quantile by Wilson and Hilferty 1931). The factor is infinite below about one degree.
double upper_factor(double degrees_of_freedom) {
  const double t = 2.0 / (9.0 * degrees_of_freedom), root = 1.0 - t - z_confidence * std::sqrt(t);
  return root > 0.0 ? 1.0 / (root * root * root) : std::numeric_limits<double>::infinity();
}

}  // namespace

double relative_error(const ks::Buffer& variance, const ks::Buffer& radiance, uint64_t pixels, uint32_t channels) {
  const uint64_t count = pixels * channels;
  std::vector<float> copies[2];
  const float *noise = values_of(variance, count, copies[0]), *light = values_of(radiance, count, copies[1]);
  double sum = 0.0, squares = 0.0;
  for (uint64_t i = 0; i < pixels; ++i) {
    const double pixel = std::accumulate(noise + i * channels, noise + (i + 1) * channels, 0.0);
    sum += pixel;
    squares += pixel * pixel;
  }
  if (!std::isfinite(sum)) return std::numeric_limits<double>::infinity();
  if (sum <= 0.0) return 0.0;
  // Satterthwaite 1946: the degrees of freedom follow from the variance of the mean itself, which comes from the scatter of the pixels and
  // is at least that of Gaussian replicates.
  const auto n = double(pixels);
  const double scatter = pixels > 1 ? (squares - sum * sum / n) / (n - 1.0) : 0.0;
  const double of_gaussian = 2.0 / (replicate_count - 1) * sum * sum / (n * n);
  const double freedom = 2.0 * sum * sum / (n * std::max(scatter, of_gaussian));
  const double mean_light = std::accumulate(light, light + count, 0.0) / double(count);
  return std::sqrt(sum / double(count) * upper_factor(freedom)) / mean_light;
}

}  // namespace kuafu
