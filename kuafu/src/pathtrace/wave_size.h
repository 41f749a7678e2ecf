// SPDX-License-Identifier: Apache-2.0
// These functions say how many paths a wave holds, and how pixels are spread over waves. Thread rule: pure functions.
#pragma once

#include <cstdint>

#include "device/device.h"
#include "pathtrace/wave_memory.h"

namespace kuafu {

/// The number of paths that a host worker takes through all stages at once. Their queues and state, 300 bytes a path, stay in its cache.
uint32_t host_wave_paths(uint32_t shadow_rays_per_vertex);
constexpr uint32_t waves_per_worker = 32;  // between two reports of progress
/// The most paths of a device's wave: an eighth of the GPU's memory, and no more than its dispatches hold. Of `size`, the capacity does not
/// count.
uint32_t most_paths(const ks::Device& device, const WaveSize& size);
/// The most paths of a wave on a GPU with this memory, whose dispatches have at most most_groups groups.
uint32_t gpu_wave_paths(uint64_t memory_bytes, uint32_t most_groups, const WaveSize& size);
/// The pixels of each of as few waves as `total` needs, `most` at most: even ones take less memory than full ones and a rest.
uint32_t even_wave(uint32_t total, uint32_t most);
/// The most samples that a pixel has in one wave. The number is fixed, since the order of sums follows from it; the rounds of a budget are
/// short.
constexpr uint32_t most_pass_samples(bool in_rounds) { return in_rounds ? 32 : 256; }
/// A stride near the golden section of n, coprime to n, and small enough that block * stride stays below 2^32.
uint32_t permutation_stride(uint32_t n);

}  // namespace kuafu
