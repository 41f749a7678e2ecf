#include "signal/grain.h"

#include <cmath>

#include "cpu/signal/rows.h"
#include "device/thread_pool.h"

namespace simsense {
std::vector<float> grain_kernel(float sigma_px) {
  const int radius = static_cast<int>(std::ceil(4 * sigma_px));
  std::vector<float> weights;
  double squares = 0;
  for (int k = -radius; k <= radius; ++k) {
    const double weight = std::exp(-0.5 * k * k / (static_cast<double>(sigma_px) * sigma_px));
    weights.push_back(static_cast<float>(weight));
    squares += weight * weight;
  }
  for (float& weight : weights) weight /= static_cast<float>(std::sqrt(squares));
  return weights;
}

cpu::Buffer<float> grain_normals(const PhiloxKey& key, Dimension dimension, float sigma_px, size_t pitch, size_t height,
                                 ks::ThreadPool& workers) {
  const std::vector<float> weights = grain_kernel(sigma_px);
  const size_t radius = weights.size() / 2, reach = cpu::round_up(radius, 4);  // rows start at a multiple of 4 pixels
  const size_t drawn = cpu::round_up(pitch + 2 * reach, cpu::row_padding);
  cpu::Buffer<float> along_rows((height + 2 * radius) * pitch), normals(height * pitch);
  workers.parallel_for(height + 2 * radius, [&](size_t row) {
    cpu::Buffer<uint32_t> words(drawn);
    cpu::Buffer<float> white(drawn);
    cpu::normal_row(key, dimension, -static_cast<int32_t>(reach), static_cast<uint32_t>(row - radius), drawn, words.data(), white.data());
    cpu::weigh_row(white.data() + reach - radius, 1, weights.data(), weights.size(), pitch, along_rows.data() + row * pitch);
  });
  workers.parallel_for(height, [&](size_t y) {
    cpu::weigh_row(along_rows.data() + y * pitch, pitch, weights.data(), weights.size(), pitch, normals.data() + y * pitch);
  });
  return normals;
}

}  // namespace simsense
