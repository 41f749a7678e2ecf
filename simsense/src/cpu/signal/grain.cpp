// SPDX-License-Identifier: Apache-2.0
#include "cpu/signal/imager.h"

#include "cpu/signal/rows.h"
#include "signal/imager.h"

namespace simsense::cpu {

Buffer<float> grain_normals(const PhiloxKey& key, Dimension dimension, float sigma_px, size_t pitch, size_t height,
                            ks::ThreadPool& workers) {
  const std::vector<float> weights = grain_kernel(sigma_px);
  const size_t radius = weights.size() / 2, reach = round_up(radius, 4);  // rows start at a multiple of 4 pixels
  const size_t drawn = round_up(pitch + 2 * reach, row_padding);
  Buffer<float> along_rows((height + 2 * radius) * pitch), normals(height * pitch);
  workers.parallel_for(height + 2 * radius, [&](size_t row) {
    Buffer<uint32_t> words(drawn);
    Buffer<float> white(drawn);
    normal_row(key, dimension, -static_cast<int32_t>(reach), static_cast<uint32_t>(row - radius), drawn, words.data(), white.data());
    weigh_row(white.data() + reach - radius, 1, weights.data(), weights.size(), pitch, along_rows.data() + row * pitch);
  });
  workers.parallel_for(height, [&](size_t y) {
    weigh_row(along_rows.data() + y * pitch, pitch, weights.data(), weights.size(), pitch, normals.data() + y * pitch);
  });
  return normals;
}

}  // namespace simsense::cpu
