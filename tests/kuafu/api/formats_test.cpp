// SPDX-License-Identifier: Apache-2.0
// Output formats: what float32 images and ids become in narrower numbers, on both kinds of stages, packed and strided.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <glm/gtc/packing.hpp>

#include "kuafu/world.h"

namespace {

using namespace laws;

constexpr uint32_t width = 9, height = 5, pixels = width * height;  // odd: rows of bytes share words

/// A grey ramp of depths and radiances.
class Formats : public testing::TestWithParam<uint32_t> {
 protected:
  Formats() : world_(GetParam()) {}
  void SetUp() override {
    wall_ = world_.add(quad({0, 0, 2}, {-0.3, 0, 0.1}, {0, 2, 0}), lambert(0.5f));
    world_.add_point({0.1, 0, 0}, 40.0f);
    world_.desc().samples_per_pixel = 2;
  }

  /// Renders `output` as `format` into rows of `row_bytes`, from `first_byte` on; the bytes of the whole buffer, which held `mark`s.
  std::vector<uint8_t> render(uint32_t output, uint32_t format, uint64_t row_bytes, uint64_t first_byte = 0, float scale = 0,
                              uint8_t mark = 0xab) {
    std::vector<uint8_t> bytes(first_byte + row_bytes * height + 16, mark);
    kuafu_buffer buffer = nullptr;
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(bytes.size(), KS_BUFFER_HOST_VISIBLE);
    ok(kuafu_buffer_create(shared_device(), &create, &buffer));
    ok(kuafu_buffer_write(buffer, 0, bytes.data(), bytes.size()));
    const uint64_t shape[4] = {1, height, width, 1};
    kuafu_output_desc desc = kuafu_output_desc_init(output, buffer, ks_image_desc_packed(format, 4, shape));
    desc.image.byte_stride[1] = int64_t(row_bytes);
    desc.image.offset_bytes = first_byte;
    desc.scale = scale;
    const kuafu_view_desc view = view_at({0, 0, 0}, width, height, 6);
    world_.desc().views = &view;
    world_.desc().view_count = 1;
    world_.desc().outputs = &desc;
    world_.desc().output_count = 1;
    status_ = kuafu_renderer_render(world_.renderer(), world_.scene(), &world_.desc());
    ok(kuafu_buffer_read(buffer, 0, bytes.data(), bytes.size()));
    kuafu_buffer_release(buffer);
    return bytes;
  }

  template <class T>
  std::vector<T> packed(uint32_t output, uint32_t format, float scale = 0) {
    const std::vector<uint8_t> bytes = render(output, format, width * sizeof(T), 0, scale);
    EXPECT_EQ(status_, KS_OK) << kuafu_last_error();
    std::vector<T> values(pixels);
    std::memcpy(values.data(), bytes.data(), pixels * sizeof(T));
    EXPECT_EQ(bytes[pixels * sizeof(T)], 0xab);
    return values;
  }

  World world_;
  uint32_t wall_ = 0;
  ks_status status_ = KS_OK;
};

TEST_P(Formats, integers_are_the_scaled_floats_rounded_and_clamped) {
  const auto exact = packed<float>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_F32);
  ASSERT_GT(*std::max_element(exact.begin(), exact.end()), 1.0f);  // some clamp,
  ASSERT_EQ(*std::min_element(exact.begin(), exact.end()), 0.0f);  // some see past the wall
  const auto bytes = packed<uint8_t>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_U8);
  const auto words = packed<uint16_t>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_U16, 1000.0f);
  for (size_t i = 0; i < pixels; ++i) {
    EXPECT_NEAR(bytes[i], std::min(255.0, 255.0 * exact[i]), 0.5001) << exact[i];
    EXPECT_NEAR(words[i], std::min(65535.0, 1000.0 * exact[i]), 0.501) << exact[i];
  }
}

TEST_P(Formats, depth_in_millimetres) {
  const auto metres = packed<float>(KUAFU_OUTPUT_DEPTH, KS_FORMAT_F32);
  const auto millimetres = packed<uint16_t>(KUAFU_OUTPUT_DEPTH, KS_FORMAT_U16, 1000.0f);
  for (size_t i = 0; i < pixels; ++i) EXPECT_NEAR(millimetres[i], 1000.0 * metres[i], 0.501);
  EXPECT_GT(*std::max_element(millimetres.begin(), millimetres.end()), 1900);
}

TEST_P(Formats, half_floats_are_the_nearest) {
  const auto exact = packed<float>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_F32);
  const auto halves = packed<uint16_t>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_F16);
  const auto many = packed<uint16_t>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_F16, 1e9f);
  for (size_t i = 0; i < pixels; ++i) {
    EXPECT_NEAR(glm::unpackHalf1x16(halves[i]), exact[i], exact[i] / 2048 * 1.001) << i;
    EXPECT_EQ(glm::unpackHalf1x16(many[i]), exact[i] > 0 ? 65504.0f : 0.0f) << i;
  }
}

TEST_P(Formats, scaled_floats_leave_the_path_of_plain_ones) {
  const auto exact = packed<float>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_F32);
  const auto doubled = packed<float>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_F32, 2.0f);
  for (size_t i = 0; i < pixels; ++i) EXPECT_EQ(doubled[i], 2.0f * exact[i]);
}

TEST_P(Formats, narrow_ids_keep_none) {
  const auto wide = packed<uint32_t>(KUAFU_OUTPUT_INSTANCE_ID, KS_FORMAT_U32);
  const auto words = packed<uint16_t>(KUAFU_OUTPUT_INSTANCE_ID, KS_FORMAT_U16);
  const auto bytes = packed<uint8_t>(KUAFU_OUTPUT_INSTANCE_ID, KS_FORMAT_U8);
  EXPECT_EQ(std::count(wide.begin(), wide.end(), wall_ - 1) + std::count(wide.begin(), wide.end(), KUAFU_NOTHING_HIT), pixels);
  EXPECT_GT(std::count(wide.begin(), wide.end(), KUAFU_NOTHING_HIT), 0);
  for (size_t i = 0; i < pixels; ++i) {
    EXPECT_EQ(words[i], wide[i] == KUAFU_NOTHING_HIT ? 0xffffu : wide[i]);
    EXPECT_EQ(bytes[i], wide[i] == KUAFU_NOTHING_HIT ? 0xffu : wide[i]);
  }
}

TEST_P(Formats, ids_that_do_not_fit_are_refused) {
  const kuafu_material_desc material = lambert(0.1f);
  uint32_t id = 0;
  do ok(kuafu_scene_add_material(world_.scene(), &material, &id));
  while (id < 255);  // which the picture has as 254
  render(KUAFU_OUTPUT_MATERIAL_ID, KS_FORMAT_U8, width);
  EXPECT_EQ(status_, KS_OK) << kuafu_last_error();
  ok(kuafu_scene_add_material(world_.scene(), &material, &id));
  render(KUAFU_OUTPUT_MATERIAL_ID, KS_FORMAT_U8, width);
  expect_refused(status_, "material ids go to 255");
}

TEST_P(Formats, odd_rows_of_bytes_touch_no_neighbour) {
  const auto packed_bytes = packed<uint8_t>(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_U8);
  for (const uint64_t first : {1u, 2u, 3u, 7u}) {
    const uint64_t row = width + 2;
    const auto bytes = render(KUAFU_OUTPUT_RADIANCE, KS_FORMAT_U8, row, first);
    ASSERT_EQ(status_, KS_OK) << kuafu_last_error();
    for (size_t i = 0; i < bytes.size(); ++i) {
      const size_t r = (i - first) / row, c = (i - first) % row;
      const bool inside = i >= first && r < height && c < width;
      ASSERT_EQ(bytes[i], inside ? packed_bytes[r * width + c] : 0xab) << first << " " << i;
    }
  }
}

TEST_P(Formats, wrong_scales_and_formats_are_named) {
  for (const auto& [output, format, scale, part] : {std::tuple{KUAFU_OUTPUT_RADIANCE, KS_FORMAT_U32, 0.0f, "KS_FORMAT_F32"},
                                                    {KUAFU_OUTPUT_RADIANCE, KS_FORMAT_I16, 0.0f, "KS_FORMAT_F32"},
                                                    {KUAFU_OUTPUT_INSTANCE_ID, KS_FORMAT_F32, 0.0f, "KS_FORMAT_U32"},
                                                    {KUAFU_OUTPUT_INSTANCE_ID, KS_FORMAT_U32, 2.0f, "not scaled"},
                                                    {KUAFU_OUTPUT_DEPTH, KS_FORMAT_F32, -1.0f, "scale -1"},
                                                    {KUAFU_OUTPUT_DEPTH, KS_FORMAT_F32, NAN, "finite"}}) {
    render(output, format, 4 * width, 0, scale);
    expect_refused(status_, part);
  }
}

/// The error of a render of one view of w x h pixels into bytes whose rows overlap, so that the buffer is small.
std::string error_of(uint32_t w, uint32_t h, uint32_t band, double relative_error, uint32_t denoise) {
  World world;
  world.add_point({0, 0, 0}, 1.0f);
  kuafu_view_desc view = view_at({0, 0, 0}, w, h, 1000);
  view.band = band;
  const uint64_t shape[4] = {1, h, w, band == KUAFU_BAND_VISIBLE ? 3u : 1u};
  ks_image_desc image = ks_image_desc_packed(KS_FORMAT_U8, 4, shape);
  image.byte_stride[1] = 1;
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(h + 3ull * w, KS_BUFFER_HOST_VISIBLE);
  kuafu_buffer buffer = nullptr;
  ok(kuafu_buffer_create(shared_device(), &create, &buffer));
  const kuafu_output_desc output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer, image);
  kuafu_render_desc& desc = world.desc();
  desc.views = &view;
  desc.outputs = &output;
  desc.view_count = desc.output_count = 1;
  desc.relative_error = relative_error;
  desc.denoise = denoise;
  EXPECT_EQ(kuafu_renderer_render(world.renderer(), world.scene(), &desc), KS_ERROR_INVALID_ARGUMENT);
  kuafu_buffer_release(buffer);
  return kuafu_last_error();
}

TEST(LargeImages, what_32_bits_cannot_count_is_refused_before_it_is_allocated) {
  for (const auto& [error, part] : {std::pair{error_of(32768, 30000, KUAFU_BAND_VISIBLE, 0, KUAFU_DENOISE_NONE), "between the steps"},
                                    {error_of(32768, 16384, KUAFU_BAND_INFRARED, 0.1, KUAFU_DENOISE_NONE), "budgets"},
                                    {error_of(32768, 16384, KUAFU_BAND_INFRARED, 0, KUAFU_DENOISE_ATROUS), "denoiser"}})
    EXPECT_NE(error.find(part), std::string::npos) << error;
}

INSTANTIATE_TEST_SUITE_P(Stages, Formats, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE), stages_name);

}  // namespace
