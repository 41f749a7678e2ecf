#include "pathtrace/budget.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "shared/wave.h"

namespace kuafu {

Budget::Budget(uint32_t samples, double max_seconds, double relative_error)
    : samples_(samples), next_(samples), max_seconds_(max_seconds), relative_error_(relative_error) {
  if (relative_error > 0)
    next_ = std::min(samples, 2 * replicate_count);
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
    // The error falls at least with the root of the samples; a tenth more, so that the last round seldom falls short.
    const double missing = 1.1 * all_samples * (std::pow(relative_error / relative_error_, 2) - 1);
    more = relative_error <= relative_error_ ? 0 : std::min(more, std::ceil(missing / step) * step);
  }
  if (max_seconds_ > 0) more = std::min(more, std::floor(std::max(0.0, max_seconds_ - seconds) / (per_sample_s * step)) * step);
  next_ = uint32_t(std::min<double>(more, samples_ - done_));
}

double relative_error(const ks::Buffer& variance, const ks::Buffer& radiance, uint64_t count) {
  const auto sum = [count](const ks::Buffer& image) {
    std::vector<float> copy;
    const auto* values = static_cast<const float*>(image.mapped());
    if (values == nullptr) {
      copy.resize(count);
      image.read(0, copy.data(), count * sizeof(float));
      values = copy.data();
    }
    return std::accumulate(values, values + count, 0.0);
  };
  const double noise = sum(variance);
  return noise > 0 ? std::sqrt(noise / double(count)) / (sum(radiance) / double(count)) : 0.0;
}

}  // namespace kuafu
