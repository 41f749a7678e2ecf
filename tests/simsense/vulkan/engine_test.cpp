// The engine gives the same outputs whichever back end matches, for a whole batch, with rectification and depth around it.
#include "engine.h"

#include <gtest/gtest.h>

#include "capi/device/devices.h"
#include "device/error.h"
#include "simsense/rig_samples.h"
#include "simsense/stages/stereo_pair.h"

namespace {

using simsense::Engine;

constexpr uint32_t width = 64, height = 48, batch = 3, pixels = width * height;

simsense_parameters small_parameters() {
  simsense_parameters p = simsense_parameters_init();
  p.max_disparity = 32;
  p.block_width = p.block_height = 3;
  return p;
}

simsense_rig_desc rig(uint32_t back_end) {
  simsense_rig_desc r = simsense_test::crooked_rig(width, height, 43);
  r.batch_count = batch;
  r.back_end = back_end;
  return r;
}

simsense::ImageArgument packed(void* host, uint32_t format) {
  const uint64_t shape[3] = {batch, height, width};
  simsense::ImageArgument argument;
  argument.host = host;
  argument.image = ks_image_desc_packed(format, 3, shape);
  return argument;
}

struct Maps {
  std::vector<float> disparity = std::vector<float>(batch * pixels), depth = disparity;
  bool operator==(const Maps&) const = default;
};

Maps compute(Engine& engine) {
  std::vector<uint8_t> left, right;
  for (uint32_t n = 0; n < batch; ++n) {
    const StereoPair pair = random_dots(width, height, 4 + 3 * n, 10, n);
    left.insert(left.end(), pair.left.begin(), pair.left.end());
    right.insert(right.end(), pair.right.begin(), pair.right.end());
  }
  Maps maps;
  simsense::ComputeRequest request;
  request.left = packed(left.data(), KS_FORMAT_U8);
  request.right = packed(right.data(), KS_FORMAT_U8);
  request.outputs = {{SIMSENSE_OUTPUT_DISPARITY, packed(maps.disparity.data(), KS_FORMAT_F32)},
                     {SIMSENSE_OUTPUT_DEPTH, packed(maps.depth.data(), KS_FORMAT_F32)}};
  engine.compute(request);
  return maps;
}

TEST(vulkan_engine, both_back_ends_give_the_same_maps) {
  const auto device = ks::test::best_device();
  simsense_parameters p = small_parameters();
  Engine cpu(device, rig(SIMSENSE_BACK_END_CPU), p), vulkan(device, rig(SIMSENSE_BACK_END_VULKAN), p);
  const Maps first = compute(cpu);
  EXPECT_GT(*std::max_element(first.disparity.begin(), first.disparity.end()), 0.0f);
  EXPECT_EQ(first, compute(vulkan));
  p.p2 = 40;
  cpu.set_parameters(p);
  vulkan.set_parameters(p);
  const Maps second = compute(cpu);
  EXPECT_NE(first, second);
  EXPECT_EQ(second, compute(vulkan));
}

TEST(vulkan_engine, a_back_end_that_cannot_serve_is_refused) {
  EXPECT_THROW(Engine(ks::test::host_device(), rig(SIMSENSE_BACK_END_VULKAN), small_parameters()), ks::Error);
  EXPECT_THROW(Engine(ks::test::host_device(), rig(3), small_parameters()), ks::Error);
  Engine chosen(ks::test::host_device(), rig(SIMSENSE_BACK_END_AUTO), small_parameters());
  EXPECT_NO_THROW(compute(chosen));
}

}  // namespace
