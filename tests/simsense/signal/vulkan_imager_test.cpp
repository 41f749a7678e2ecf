// SPDX-License-Identifier: Apache-2.0
// The imagers in Vulkan compute: the scalar reference's counts but for rounding, in every format and stride, for batches however split.
#include "vulkan/signal/imager.h"

#include <gtest/gtest.h>

#include "capi/device/devices.h"
#include "simsense/reference/imager.h"
#include "simsense/signal/signal_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

constexpr uint32_t width = 101, height = 43, pixels = width * height;
const NoiseKey key{5, 9, 4, 2, 1};

const auto device = ks::test::shared_best_device;

ImageRef packed_ref(const ks::Buffer& buffer, uint32_t format, uint32_t w, uint32_t h) {
  return {buffer.address(), format, 0, static_cast<int>(w * h), static_cast<int>(w), 1, 0};
}

std::shared_ptr<ks::Buffer> upload(const void* data, uint64_t bytes) {
  auto buffer = ks::Buffer::create(device(), bytes, 0);
  buffer->write(0, data, bytes);
  return buffer;
}

/// 16-bit counts of keys.size() images of light that lie as `light` says.
std::vector<double> run(const simsense_signal& signal, const std::vector<NoiseKey>& keys, const LightRefs& light, uint32_t w = width,
                        uint32_t h = height) {
  static VulkanImagers small(device(), width, height), field(device(), field_width, field_height);
  VulkanImagers& imagers = w == width ? small : field;
  const size_t count = keys.size() * w * h;
  const auto counts = ks::Buffer::create(device(), count * 2, 0);
  ks::Commands commands(device());
  imagers.record(commands, keys[0].side, Imager(signal), keys, light, packed_ref(*counts, KS_FORMAT_U16, w, h), {});
  commands.flush();
  std::vector<uint16_t> found(count);
  counts->read(0, found.data(), count * 2);
  return {found.begin(), found.end()};
}

std::vector<double> run(const simsense_signal& signal, const std::vector<float>& image, uint32_t w = width, uint32_t h = height) {
  const auto light = upload(image.data(), image.size() * 4);
  return run(signal, {key}, {packed_ref(*light, KS_FORMAT_F32, w, h), {}}, w, h);
}

const std::vector<float> image = ramp(pixels);

}  // namespace

TEST(VulkanImager, EqualsTheReferenceButForRounding) {
  for (const auto& [name, signal] : every_stage())
    expect_equal_but_for_rounding(run(signal, image), reference::measure(signal, key, {image.begin(), image.end()}, width, height), name);
}

TEST(VulkanImager, SpeckleOfTheLaserAloneEqualsTheReferenceButForRounding) {
  const std::vector<float> laser = laser_part(image);
  const auto all = upload(image.data(), image.size() * 4), part = upload(laser.data(), laser.size() * 4);
  const LightRefs light{packed_ref(*all, KS_FORMAT_F32, width, height), packed_ref(*part, KS_FORMAT_F32, width, height)};
  for (const auto& [name, signal] : every_stage()) {
    if (signal.speckle_shape == 0) continue;
    const auto exact = reference::measure(signal, key, {image.begin(), image.end()}, width, height, {laser.begin(), laser.end()});
    expect_equal_but_for_rounding(run(signal, {key}, light), exact, name);
  }
}

TEST(VulkanImager, GivesABatchTheImagesOfItsViewsAlone) {
  std::vector<NoiseKey> keys;
  for (uint32_t view = 0; view < 3; ++view) keys.push_back({5, 9, 4, view, 1});
  std::vector<float> images;
  for (size_t n = 0; n < keys.size(); ++n)
    for (const float value : image) images.push_back(value + static_cast<float>(n));
  const auto light = upload(images.data(), images.size() * 4);
  for (const auto& [name, signal] : every_stage()) {
    const auto all = run(signal, keys, {packed_ref(*light, KS_FORMAT_F32, width, height), {}});
    ImageRef last = packed_ref(*light, KS_FORMAT_F32, width, height);
    last.first = 2 * pixels;
    const auto alone = run(signal, {keys[2]}, {last, {}});
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), all.begin() + 2 * pixels)) << name;
  }
}

TEST(VulkanImager, ReadsAndWritesAnyStridesAndFormats) {
  std::vector<uint16_t> spaced(size_t{2} * height * 3 * width, 9999);  // flipped both ways, every third column, every second row
  std::vector<uint8_t> bytes(pixels);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) {
      const float value = image[y * width + x];
      spaced[size_t{2} * (height - 1 - y) * 3 * width + 3 * (width - 1 - x)] = static_cast<uint16_t>(value);
      bytes[y * width + x] = static_cast<uint8_t>(value);
    }
  const auto light_16 = upload(spaced.data(), spaced.size() * 2), light_8 = upload(bytes.data(), pixels);
  const auto out = ks::Buffer::create(device(), pixels * 2, 0);
  const ImageRef flipped{light_16->address(), KS_FORMAT_U16, 2 * (height - 1) * 3 * width + 3 * (width - 1), 0, -int{6 * width}, -3, 0};
  const ImageRef turned{out->address(), KS_FORMAT_U8, pixels - 1, 0, -int{width}, -1, 0};
  const simsense_signal signal = signal_preset("paper-d415");
  VulkanImagers imagers(device(), width, height);
  ks::Commands commands(device());
  imagers.record(commands, 0, Imager(signal), std::vector{key}, {flipped, {}}, {}, turned);
  commands.flush();
  std::vector<uint8_t> found(pixels);
  out->read(0, found.data(), pixels);
  const auto expected = run(signal, image);
  EXPECT_EQ(expected, run(signal, {key}, {packed_ref(*light_8, KS_FORMAT_U8, width, height), {}}));
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), found.rbegin()));
}

TEST(VulkanImager, StaysInRangeUnderAnyInput) {
  std::vector<float> light(pixels, 0.0f);
  std::copy(wild.begin(), wild.end(), light.begin());
  for (const auto& [name, signal] : every_stage()) expect_in_range(run(signal, light), name, signal);
}

TEST(VulkanImager, BothEyesOfOneRecordingMayHaveGrainsOfTheirOwn) {
  simsense_signal fine = signal_preset("paper-d415");
  fine.speckle_psf_sigma_px = 0.5f;
  simsense_signal coarse = fine;
  coarse.speckle_psf_sigma_px = 16;
  const std::vector<float> image(size_t{field_width} * field_height, 100);
  const auto light = upload(image.data(), image.size() * 4);
  const ImageRef from = packed_ref(*light, KS_FORMAT_F32, field_width, field_height);
  NoiseKey keys[2] = {key, key};
  keys[0].side = 0;
  VulkanImagers imagers(device(), field_width, field_height);
  const auto counts = ks::Buffer::create(device(), image.size() * 4, 0);
  ks::Commands commands(device());
  ImageRef to = packed_ref(*counts, KS_FORMAT_U16, field_width, field_height);
  imagers.record(commands, 0, Imager(fine), {&keys[0], 1}, {from, {}}, to, {});
  const uint64_t recorded_bytes = imagers.memory_bytes();
  to.first = static_cast<uint32_t>(image.size());
  imagers.record(commands, 1, Imager(coarse), {&keys[1], 1}, {from, {}}, to, {});
  EXPECT_EQ(imagers.memory_bytes(), recorded_bytes) << "an array that recorded work uses was replaced";
  commands.flush();
  std::vector<uint16_t> found(2 * image.size());
  counts->read(0, found.data(), found.size() * 2);
  for (const uint32_t side : {0u, 1u}) {
    const auto alone = run(side ? coarse : fine, {keys[side]}, {from, {}}, field_width, field_height);
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), found.begin() + static_cast<ptrdiff_t>(side * image.size()))) << "side " << side;
  }
}
