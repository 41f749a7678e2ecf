// SPDX-License-Identifier: Apache-2.0
// The order of pixels in a launch, and how large one is.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "capi/device/devices.h"
#include "frame/host_language.h"
#include "optics/optics.h"
#include "pathtrace/wave_size.h"
#include "shared/ray_queue.h"

namespace kuafu {
namespace {

TEST(LaunchSize, a_wave_s_shadow_rays_fit_one_dispatch) {
  constexpr uint32_t most_groups = 65535, smallest_group = 32;
  constexpr uint64_t memory_bytes = 64ull << 30;
  for (uint32_t shadows = 0; shadows <= 40; ++shadows) {
    const uint64_t paths = gpu_wave_paths(memory_bytes, most_groups, {.shadow_rays_per_vertex = shadows});
    EXPECT_LE(paths * std::max(1u, shadows), uint64_t(most_groups) * smallest_group) << shadows;
    EXPECT_GT(paths, 32768u) << shadows;
  }
}

TEST(LaunchSize, a_wave_s_queues_fit_allocations_of_4_GB) {
  for (uint32_t shadows = 0; shadows <= 64; ++shadows) {
    for (const bool glass : {false, true}) {
      const WaveSize size{.channels = 3, .shadow_rays_per_vertex = shadows, .glass_passes = glass ? 8u : 0u};
      const uint64_t paths = gpu_wave_paths(uint64_t(1) << 40, 0x7fffffff, size);
      EXPECT_LT(paths * WordsPerPath(size).widest_array() * 4, uint64_t(1) << 32) << shadows;
      EXPECT_GT(paths, glass ? 50000u : 500000u) << shadows;
    }
  }
}

TEST(LaunchSize, a_wave_takes_no_more_memory_than_plain_infrared_paths_do) {
  const uint64_t memory_bytes = uint64_t(140) << 30;
  const WaveSize plain{.shadow_rays_per_vertex = 1}, batch{.shadow_rays_per_vertex = 2, .environments = true};
  EXPECT_EQ(gpu_wave_paths(memory_bytes, 0x7fffffff, plain), 1u << 24);
  EXPECT_EQ(WordsPerPath(plain).all(), 51u);
  for (const WaveSize& size : {plain, batch})
    EXPECT_LE(4ull * WordsPerPath(size).all() * gpu_wave_paths(memory_bytes, 0x7fffffff, size), 3'425'000'000u);
}

TEST(LaunchSize, even_waves_are_as_few_as_full_ones_and_no_larger) {
  for (const uint32_t most : {32u, 1000u, 3'101'000u})
    for (const uint32_t total : {1u, 32u, 999u, 1001u, 31'000u, 256u * 2 * 128 * 128}) {
      if (total < most) continue;  // then one wave has all
      const uint32_t even = even_wave(total, most), full_waves = (total + most - 1) / most;
      EXPECT_LE(even, most);
      EXPECT_EQ((total + even - 1) / even, full_waves) << total << " by " << most;
      EXPECT_LT(even - total / full_waves, 33u) << total << " by " << most;
    }
  const WaveSize batch{.shadow_rays_per_vertex = 2, .environments = true};
  const uint32_t samples = 4, paths = gpu_wave_paths(uint64_t(140) << 30, 0x7fffffff, batch);
  EXPECT_LT(even_wave(256 * 2 * 128 * 128, paths / samples), 0.91 * paths / samples);
}

// 4096 x 2049 pixels of 128 invocations a group are 65568 groups. Vignetting twice as bright in the corners reaches the last of them.
TEST(LaunchSize, an_image_may_have_more_pixels_than_a_line_of_groups) {
  SKIP_IF(ks::test::why_no_cpu_device());
  const Memory memory{ks::test::cpu_device(), false};
  Launch launch;
  launch.width = 4096;
  launch.height = 2049;
  launch.band.infrared = true;
  launch.views.resize(1);
  launch.views[0].optics.vignetting_polynomial[0] = 1.0;
  launch.held = 1u << output_radiance;
  launch.outputs[output_radiance].buffer = ks::Buffer::create(memory.device, 4, 0);
  Frame frame(memory);
  frame.fit(launch);
  auto* values = static_cast<float*>(frame.image(output_radiance).mapped());
  std::fill_n(values, launch.pixel_count(), 1.0f);
  CameraOptics optics(memory);
  ks::Commands commands(memory.device);
  optics.run(commands, launch, frame);
  commands.flush();
  EXPECT_NEAR(values[0], 2, 1e-5);
  EXPECT_NEAR(values[1024 * 4096 + 2048], 1, 1e-5);
  EXPECT_NEAR(values[launch.pixel_count() - 1], 2, 1e-5);
}

#include "lib/pixels.glsl"

constexpr uint32_t views = 3;

WaveRange order(uint32_t width, uint32_t height, bool permuted) {
  WaveRange range{};
  range.width = width, range.height = height;
  range.block_count = width * height * views / pixel_block;
  range.block_stride = permuted ? permutation_stride(range.block_count) : 0;
  return range;
}

TEST(PixelOrder, holds_each_pixel_once) {
  for (const glm::uvec2 size : {glm::uvec2(64, 36), {40, 10}, {37, 8}, {848, 480}, {1, 1}})
    for (const bool permuted : {false, true}) {
      const WaveRange range = order(size.x, size.y, permuted);
      std::vector<int> seen(size_t(size.x) * size.y * views);
      for (uint32_t p = 0; p < seen.size(); ++p) {
        const Pixel pixel = wave_pixel(range, p);
        ASSERT_TRUE(pixel.view < views && pixel.row < size.y && pixel.column < size.x) << p;
        ++seen[(size_t(pixel.view) * size.y + pixel.row) * size.x + pixel.column];
      }
      EXPECT_EQ(std::ranges::count(seen, 1), ptrdiff_t(seen.size())) << size.x << " x " << size.y << (permuted ? ", permuted" : "");
    }
}

// A warp's rays should be neighbours: of 4 samples a pixel it has 8 pixels, 4 x 2.
TEST(PixelOrder, tiles_hold_neighbours) {
  const WaveRange range = order(64, 36, false);
  for (uint32_t first = 0; first < 64 * 36; first += 8)
    for (uint32_t i = 1; i < 8; ++i) {
      const Pixel a = wave_pixel(range, first), b = wave_pixel(range, first + i);
      EXPECT_TRUE(b.row - a.row < 2 && b.column - a.column < 4) << first << ", " << i;
    }
}

}  // namespace
}  // namespace kuafu
