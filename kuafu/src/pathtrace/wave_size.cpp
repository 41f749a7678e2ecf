// SPDX-License-Identifier: Apache-2.0
#include "pathtrace/wave_size.h"

#include <algorithm>
#include <numeric>

namespace kuafu {
namespace {

// These numbers of paths in flight measured best: they fill the device and fit a CPU's caches. On a GPU each bounce ends in a few long
// rays, whose time a larger wave spreads over more paths: an H200 takes 61 ms for what takes 104 ms in waves of 2^22. Waves of 2^25 would
// take 1 to 3 % less time, and twice the memory. Paths that need more than the 204 bytes of a plain infrared one come in smaller waves.
constexpr uint32_t host_wave = 1u << 11, cpu_wave = 1u << 14, gpu_wave = 1u << 24;
constexpr uint64_t gpu_wave_bytes = 204ull * gpu_wave;
constexpr uint64_t most_array_bytes = 3ull << 30;  // drivers give no more than 4 GB to an allocation
constexpr uint64_t smallest_group = 32;            // a stage or a tracer on a GPU dispatches no smaller one

}  // namespace

uint32_t permutation_stride(uint32_t n) {
  if (n < 3) return 1;
  uint32_t stride = std::max(1u, std::min(uint32_t(0.618 * n), 0xffffffffu / n));
  while (std::gcd(stride, n) != 1) --stride;
  return stride;
}

uint32_t host_wave_paths(uint32_t shadow_rays_per_vertex) { return host_wave / (1 + shadow_rays_per_vertex / 4); }

uint32_t even_wave(uint32_t total, uint32_t most) {
  const uint32_t waves = (total + most - 1) / most, even = (total + waves - 1) / waves;
  return std::min(most, (even + pixel_block - 1) / pixel_block * pixel_block);
}

uint32_t most_paths(const ks::Device& device, const WaveSize& size) {
  if (device.is_cpu()) return cpu_wave / (1 + size.shadow_rays_per_vertex / 4);
  return gpu_wave_paths(device.info().memory_bytes, device.limits().maxComputeWorkGroupCount[0], size);
}

uint32_t gpu_wave_paths(uint64_t memory_bytes, uint32_t most_groups, const WaveSize& size) {
  const WordsPerPath words(size);
  const uint64_t bytes = std::min(memory_bytes / 8, gpu_wave_bytes), groups = uint64_t(most_groups) * smallest_group;
  // All shadow rays of a pass stand in one queue.
  return uint32_t(std::min({bytes / (uint64_t(4) * words.all()), uint64_t(gpu_wave),
                            most_array_bytes / (uint64_t(4) * words.widest_array()), groups / std::max(1u, size.shadow_rays_per_path())}));
}

}  // namespace kuafu
