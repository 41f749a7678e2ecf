// SPDX-License-Identifier: Apache-2.0
// simsense_engine_compute's promises: any strides, formats and outputs, batches, seeded noise, no copies, parameters that change.
#include <cstring>
#include <functional>
#include <string>
#include <thread>

#include "simsense/api/plane_scene.h"
#include "simsense/api/sensor.h"
#include "simsense/rig_samples.h"

using namespace simsense_test;

namespace {

constexpr uint32_t width = 160, height = 96;

simsense_rig_desc small_rig(uint32_t batch = 1) {
  simsense_rig_desc rig = ideal_rig(width, height, 215);
  rig.rgb = camera(120, 80, 150);
  rig.left_to_rgb[3] = 0.015;
  rig.batch_count = batch;
  return rig;
}

Pair photograph(double z, uint32_t seed = 1) {
  Plane plane;
  plane.distance_m = z;
  plane.cell_m = 3 * z / 215;
  plane.seed = seed;
  return photograph(plane, small_rig());
}

std::vector<float> depth_of(const EngineHandle& engine, const Pair& pair) {
  return compute_one<float>(engine, SIMSENSE_OUTPUT_DEPTH, pair, height, width, {height, width});
}

/// The same image in other memory: rows from bottom to top, columns from right to left, padded, as any of the three formats.
template <class T>
struct Scattered {
  std::vector<T> memory;
  simsense_image image{};

  explicit Scattered(const std::vector<uint8_t>& pixels) : memory(size_t{width + 5} * height * 2, T(201)) {
    const ptrdiff_t row = -2 * ptrdiff_t{width + 5}, first = ptrdiff_t{2} * (width + 5) * (height - 1) + 2 * (width - 1);
    for (ptrdiff_t y = 0; y < height; ++y)
      for (ptrdiff_t x = 0; x < width; ++x)
        memory[static_cast<size_t>(first + y * row - 2 * x)] = pixels[static_cast<size_t>(y * width + x)];
    const uint64_t shape[] = {height, width};
    image.host = memory.data();
    image.image = ks_image_desc_packed(format_of<T>, 2, shape);
    image.image.offset_bytes = static_cast<uint64_t>(first) * sizeof(T);
    image.image.byte_stride[0] = row * static_cast<ptrdiff_t>(sizeof(T));
    image.image.byte_stride[1] = -2 * static_cast<ptrdiff_t>(sizeof(T));
  }
};

std::vector<std::string> stage_names(const EngineHandle& engine) {
  uint32_t count = 0;
  EXPECT_EQ(simsense_engine_get_stage_times(engine.get(), nullptr, &count), KS_OK);
  std::vector<ks_stage_time> times(count);
  EXPECT_EQ(simsense_engine_get_stage_times(engine.get(), times.data(), &count), KS_OK);
  std::vector<std::string> names;
  for (const ks_stage_time& t : times) {
    EXPECT_GE(t.milliseconds, 0);
    names.emplace_back(t.name);
  }
  return names;
}

uint64_t copied_bytes(const Device& device) {
  uint64_t bytes = 0;
  EXPECT_EQ(simsense_device_copied_bytes(device.get(), &bytes), KS_OK);
  return bytes;
}

bool contains(const std::vector<std::string>& names, const char* name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

template <class T>
void expect_same_depth(const EngineHandle& engine, const Pair& pair, const std::vector<float>& expected) {
  const Scattered<T> left(pair.left), right(pair.right);
  std::vector<float> depth(expected.size());
  expect_computed(engine, left.image, right.image, {output_of(SIMSENSE_OUTPUT_DEPTH, host_image(depth, {height, width}))});
  EXPECT_EQ(depth, expected);
}

}  // namespace

TEST(Engine, ReadsAnyStridesAndFormats) {
  const EngineHandle engine = open_engine(small_rig(), small_parameters());
  const Pair pair = photograph(0.7);
  const auto expected = depth_of(engine, pair);
  expect_same_depth<uint8_t>(engine, pair, expected);
  expect_same_depth<uint16_t>(engine, pair, expected);
  expect_same_depth<float>(engine, pair, expected);
}

TEST(Engine, WritesAnyStrides) {
  const EngineHandle engine = open_engine(small_rig(), small_parameters(), noisy_signal());
  const Pair pair = photograph(0.7);
  const std::pair<uint32_t, uint32_t> outputs[] = {{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32},
                                                   {SIMSENSE_OUTPUT_DEPTH, KS_FORMAT_F32},
                                                   {SIMSENSE_OUTPUT_IR_LEFT, KS_FORMAT_U8},
                                                   {SIMSENSE_OUTPUT_RECTIFIED_RIGHT, KS_FORMAT_U8}};
  for (const auto& [output, format] : outputs) {
    const size_t element = ks_format_bytes(format);
    const uint64_t shape[] = {height, width};
    std::vector<std::byte> packed(width * height * element), transposed(packed.size());
    simsense_image plain{}, turned{};  // column-major, columns from right to left
    plain.host = packed.data();
    turned.host = transposed.data();
    plain.image = turned.image = ks_image_desc_packed(format, 2, shape);
    turned.image.offset_bytes = (width - 1) * height * element;
    turned.image.byte_stride[0] = static_cast<int64_t>(element);
    turned.image.byte_stride[1] = -static_cast<int64_t>(height * element);
    const simsense_image left = host_image(pair.left, {height, width}), right = host_image(pair.right, {height, width});
    expect_computed(engine, left, right, {output_of(output, plain)});
    expect_computed(engine, left, right, {output_of(output, turned)});
    size_t different = 0;
    for (size_t y = 0; y < height; ++y)
      for (size_t x = 0; x < width; ++x)
        different += std::memcmp(packed.data() + (y * width + x) * element, transposed.data() + ((width - 1 - x) * height + y) * element,
                                 element) != 0;
    EXPECT_EQ(different, 0u) << "output " << output;
  }
}

TEST(Engine, BatchEqualsItsPairs) {
  const Device device = open_device();
  const EngineHandle single = open_engine(device, small_rig(), small_parameters());
  const EngineHandle batch = open_engine(device, small_rig(3), small_parameters());
  std::vector<uint8_t> left, right;
  std::vector<float> expected;
  for (uint32_t n = 0; n < 3; ++n) {
    const Pair pair = photograph(0.5 + 0.2 * n, n);
    left.insert(left.end(), pair.left.begin(), pair.left.end());
    right.insert(right.end(), pair.right.begin(), pair.right.end());
    const auto points = compute_one<float>(single, SIMSENSE_OUTPUT_POINTS, pair, height, width, {80, 120, 3});
    expected.insert(expected.end(), points.begin(), points.end());
  }
  std::vector<float> points(expected.size());
  expect_computed(batch, host_image(left, {3, height, width}), host_image(right, {3, height, width}),
                  {output_of(SIMSENSE_OUTPUT_POINTS, host_image(points, {3, 80, 120, 3}))});
  EXPECT_EQ(points, expected);
}

TEST(Engine, GivesTheSameOutputsTogetherAsApart) {
  simsense_rig_desc rig = crooked_rig(width, height, 215);
  rig.rgb = camera(120, 80, 150);
  const EngineHandle engine = open_engine(rig, small_parameters(), noisy_signal());
  const Pair pair = photograph(0.7);
  std::vector<float> disparity(width * height), depth(width * height), depth_rgb(120 * 80), points(120 * 80 * 3);
  std::vector<uint8_t> ir[2] = {std::vector<uint8_t>(width * height), std::vector<uint8_t>(width * height)}, rectified[2] = {ir[0], ir[0]};
  const std::vector<uint64_t> shape{height, width};
  expect_computed(
      engine, host_image(pair.left, shape), host_image(pair.right, shape),
      {output_of(SIMSENSE_OUTPUT_POINTS, host_image(points, {80, 120, 3})),
       output_of(SIMSENSE_OUTPUT_DISPARITY, host_image(disparity, shape)), output_of(SIMSENSE_OUTPUT_DEPTH, host_image(depth, shape)),
       output_of(SIMSENSE_OUTPUT_DEPTH_RGB, host_image(depth_rgb, {80, 120})), output_of(SIMSENSE_OUTPUT_IR_LEFT, host_image(ir[0], shape)),
       output_of(SIMSENSE_OUTPUT_IR_RIGHT, host_image(ir[1], shape)),
       output_of(SIMSENSE_OUTPUT_RECTIFIED_LEFT, host_image(rectified[0], shape)),
       output_of(SIMSENSE_OUTPUT_RECTIFIED_RIGHT, host_image(rectified[1], shape))});
  const auto alone = [&]<class T>(uint32_t output, std::vector<uint64_t> s, T) {
    return compute_one<T>(engine, output, pair, height, width, s);
  };
  EXPECT_EQ(alone(SIMSENSE_OUTPUT_DISPARITY, shape, 0.0f), disparity);
  EXPECT_EQ(alone(SIMSENSE_OUTPUT_DEPTH, shape, 0.0f), depth);
  EXPECT_EQ(alone(SIMSENSE_OUTPUT_DEPTH_RGB, {80, 120}, 0.0f), depth_rgb);
  EXPECT_EQ(alone(SIMSENSE_OUTPUT_POINTS, {80, 120, 3}, 0.0f), points);
  for (uint32_t side = 0; side < 2; ++side) {
    EXPECT_EQ(alone(SIMSENSE_OUTPUT_IR_LEFT + side, shape, uint8_t{}), ir[side]);
    EXPECT_EQ(alone(SIMSENSE_OUTPUT_RECTIFIED_LEFT + side, shape, uint8_t{}), rectified[side]);
    EXPECT_NE(ir[side], rectified[side]);
  }
  EXPECT_GT(std::count_if(depth_rgb.begin(), depth_rgb.end(), [](float z) { return z > 0; }), 120 * 80 / 4);
}

TEST(Engine, NoiseFollowsSeedAndFrameAndNothingElse) {
  const Pair pair = photograph(0.7);
  const auto measured = [&](simsense_parameters p, uint32_t workers, uint32_t output) {
    const Device device = open_device(KS_SELECT_HOST, workers);
    const EngineHandle engine = open_engine(device, small_rig(), p, noisy_signal());
    return compute_one<uint8_t>(engine, output, pair, height, width, {height, width});
  };
  const simsense_parameters base = small_parameters();
  simsense_parameters other_seed = base, other_frame = base;
  other_seed.noise_seed = 12;
  other_frame.frame_index = 1;
  const auto first = measured(base, 1, SIMSENSE_OUTPUT_IR_LEFT);
  EXPECT_NE(first, pair.left);
  EXPECT_EQ(first, measured(base, 1, SIMSENSE_OUTPUT_IR_LEFT));
  EXPECT_EQ(first, measured(base, 5, SIMSENSE_OUTPUT_IR_LEFT));
  EXPECT_NE(first, measured(other_seed, 1, SIMSENSE_OUTPUT_IR_LEFT));
  EXPECT_NE(first, measured(other_frame, 1, SIMSENSE_OUTPUT_IR_LEFT));
}

TEST(Engine, ParametersChangeBetweenFramesAndBadOnesChangeNothing) {
  const EngineHandle engine = open_engine(small_rig(), small_parameters());
  const Pair pair = photograph(0.7);
  const auto before = depth_of(engine, pair);
  simsense_parameters p = small_parameters();
  p.max_depth_m = 0.6f;
  ASSERT_EQ(simsense_engine_set_parameters(engine.get(), &p), KS_OK);
  EXPECT_EQ(depth_of(engine, pair), std::vector<float>(before.size(), 0.0f)) << "the plane lies beyond the range now";
  p.median_size = 4;
  EXPECT_EQ(simsense_engine_set_parameters(engine.get(), &p), KS_ERROR_INVALID_ARGUMENT);
  simsense_parameters now = simsense_parameters_init();
  ASSERT_EQ(simsense_engine_get_parameters(engine.get(), &now), KS_OK);
  EXPECT_EQ(now.median_size, 3u);
  EXPECT_EQ(now.max_depth_m, 0.6f);
  p = small_parameters();
  p.max_disparity = 64;
  p.block_width = p.block_height = 1;
  ASSERT_EQ(simsense_engine_set_parameters(engine.get(), &p), KS_OK);
  EXPECT_NE(depth_of(engine, pair), before);
  p = small_parameters();
  ASSERT_EQ(simsense_engine_set_parameters(engine.get(), &p), KS_OK);
  EXPECT_EQ(depth_of(engine, pair), before);
}

TEST(Engine, TellsTheRectifiedCalibrationAndItsStages) {
  const EngineHandle engine = open_engine(small_rig(), small_parameters());
  double k[9], baseline = 0, turn[16];
  ASSERT_EQ(simsense_engine_get_rectified(engine.get(), k, &baseline, turn), KS_OK);
  EXPECT_EQ(std::memcmp(k, small_rig().left.k, sizeof k), 0);
  EXPECT_EQ(baseline, 0.05);
  EXPECT_EQ(std::memcmp(turn, identity, sizeof turn), 0);
  EXPECT_TRUE(stage_names(engine).empty()) << "nothing has run";
  const Pair pair = photograph(0.7);
  (void)compute_one<float>(engine, SIMSENSE_OUTPUT_POINTS, pair, height, width, {80, 120, 3});
  const auto names = stage_names(engine);
  for (const char* name : {"signal", "rectify", "registration", "points"}) EXPECT_TRUE(contains(names, name)) << name;
  (void)compute_one<uint8_t>(engine, SIMSENSE_OUTPUT_IR_LEFT, pair, height, width, {height, width});
  EXPECT_FALSE(contains(stage_names(engine), "registration")) << "only what the outputs need is run";
}

TEST(Engine, RefusesASecondCallWhileOneIsUnderWay) {
  const EngineHandle engine = open_engine(small_rig(), small_parameters());
  const std::vector<uint8_t> images(width * height, 9);
  std::vector<float> depth(width * height);
  const std::vector outputs{output_of(SIMSENSE_OUTPUT_DEPTH, host_image(depth, {height, width}))};
  const simsense_image image = host_image(images, {height, width});
  simsense_compute_desc second = request(image, image, outputs);
  std::function<void()> beside = [&] {
    EXPECT_EQ(simsense_engine_compute(engine.get(), &second), KS_ERROR_INVALID_STATE);
    expect_text("engine is inside another call");
  };
  simsense_compute_desc desc = second;
  desc.progress_user = &beside;
  desc.progress = [](void* call, float) -> int32_t {
    std::thread(*static_cast<std::function<void()>*>(call)).join();
    return 0;
  };
  EXPECT_EQ(simsense_engine_compute(engine.get(), &desc), KS_OK) << simsense_last_error();
  EXPECT_EQ(simsense_engine_compute(engine.get(), &second), KS_OK) << "the engine is free again: " << simsense_last_error();
}

class EngineBuffers : public testing::TestWithParam<uint32_t> {};

TEST_P(EngineBuffers, AreReadAndWrittenInPlace) {
  const Device device = open_device(GetParam());
  if (!device) GTEST_SKIP() << "no such device here: " << simsense_last_error();
  const EngineHandle engine = open_engine(device, small_rig(), small_parameters());
  const Pair pair = photograph(0.7);
  const auto expected = depth_of(engine, pair);
  const Buffer inputs = make_buffer(device, 2 * width * height), output = make_buffer(device, 16 + width * height * 4);
  void *in = nullptr, *out = nullptr;
  ASSERT_EQ(simsense_buffer_map(inputs.get(), &in), KS_OK);
  ASSERT_EQ(simsense_buffer_map(output.get(), &out), KS_OK);
  std::memcpy(in, pair.left.data(), pair.left.size());
  std::memcpy(static_cast<uint8_t*>(in) + pair.left.size(), pair.right.data(), pair.right.size());
  simsense_image left = host_image(pair.left, {height, width}), right = left, depth = host_image(expected, {height, width});
  left.buffer = right.buffer = inputs.get();
  depth.buffer = output.get();
  left.host = right.host = depth.host = nullptr;
  right.image.offset_bytes = width * height;
  depth.image.offset_bytes = 16;
  const uint64_t before = copied_bytes(device);
  expect_computed(engine, left, right, {output_of(SIMSENSE_OUTPUT_DEPTH, depth)});
  EXPECT_EQ(copied_bytes(device), before);
  EXPECT_EQ(std::memcmp(static_cast<uint8_t*>(out) + 16, expected.data(), expected.size() * 4), 0);
  const Device other = open_device();
  const EngineHandle elsewhere = open_engine(other, small_rig(), small_parameters());
  EXPECT_EQ(compute(elsewhere, left, right, {output_of(SIMSENSE_OUTPUT_DEPTH, depth)}), KS_ERROR_INVALID_ARGUMENT)
      << "a buffer of another device";
  depth.image.offset_bytes = 20;
  EXPECT_EQ(compute(engine, left, right, {output_of(SIMSENSE_OUTPUT_DEPTH, depth)}), KS_ERROR_INVALID_ARGUMENT)
      << "a view that leaves its buffer";
}

TEST(EngineBuffersOfTheBestDevice, AreNotCopiedAndHostImagesAre) {
  const Device device = open_device(KS_SELECT_AUTO);
  if (!device) GTEST_SKIP() << "no Vulkan device here: " << simsense_last_error();
  const uint64_t pixels = width * height;
  const Buffer buffer = make_buffer(device, pixels * 4, 0);
  void* mapped = nullptr;
  if (simsense_buffer_map(buffer.get(), &mapped) == KS_OK) GTEST_SKIP() << "this device, which has no memory of its own, maps every buffer";
  const EngineHandle engine = open_engine(device, small_rig(), small_parameters());
  const Pair pair = photograph(0.7);
  const auto expected = depth_of(engine, pair);
  simsense_image depth = host_image(expected, {height, width});
  depth.buffer = buffer.get();
  const uint64_t before = copied_bytes(device);
  expect_computed(engine, host_image(pair.left, {height, width}), host_image(pair.right, {height, width}),
                  {output_of(SIMSENSE_OUTPUT_DEPTH, depth)});
  EXPECT_EQ(copied_bytes(device) - before, 2 * pixels) << "the two images that lie with the host";
  std::vector<float> result(pixels);
  ASSERT_EQ(simsense_buffer_read(buffer.get(), 0, result.data(), pixels * 4), KS_OK) << simsense_last_error();
  EXPECT_EQ(result, expected);
}

INSTANTIATE_TEST_SUITE_P(Devices, EngineBuffers, testing::Values(KS_SELECT_HOST, KS_SELECT_CPU));

class EngineSubmission : public testing::TestWithParam<std::pair<uint32_t, uint32_t>> {};

TEST_P(EngineSubmission, GivesWhatComputeGivesOnceWaitedFor) {
  const auto [select, back_end] = GetParam();
  const Device device = open_device(select);
  if (!device) GTEST_SKIP() << "no such device here: " << simsense_last_error();
  simsense_rig_desc rig = small_rig();
  rig.back_end = back_end;
  const EngineHandle engine = open_engine(device, rig, small_parameters());
  const Pair pair = photograph(0.7);
  const auto expected = depth_of(engine, pair);
  const Buffer buffer = make_buffer(device, 2 * width * height + 4 * width * height);
  const simsense_buffer handle = buffer.get();
  ASSERT_EQ(simsense_buffer_write(handle, 0, pair.left.data(), pair.left.size()), KS_OK);
  ASSERT_EQ(simsense_buffer_write(handle, pair.left.size(), pair.right.data(), pair.right.size()), KS_OK);
  simsense_image left = host_image(pair.left, {height, width}), right = left, depth = host_image(expected, {height, width});
  left.buffer = right.buffer = depth.buffer = handle;
  right.image.offset_bytes = width * height;
  depth.image.offset_bytes = 2 * width * height;
  const std::vector outputs{output_of(SIMSENSE_OUTPUT_DEPTH, depth)};
  const simsense_compute_desc desc = request(left, right, outputs);
  ks_sync sync = ks_sync_init();
  ASSERT_EQ(simsense_engine_submit(engine.get(), &desc, &sync), KS_OK) << simsense_last_error();
  EXPECT_EQ(sync.kind, back_end == SIMSENSE_BACK_END_VULKAN ? KS_SYNC_TIMELINE : KS_SYNC_HOST);
  EXPECT_EQ(simsense_engine_wait_for(engine.get(), &sync, 0), sync.kind == KS_SYNC_HOST ? KS_OK : KS_ERROR_TIMEOUT)
      << "it was begun just now";
  ASSERT_EQ(simsense_engine_wait(engine.get(), &sync), KS_OK) << simsense_last_error();
  EXPECT_EQ(simsense_engine_wait_for(engine.get(), &sync, 0), KS_OK) << simsense_last_error();
  std::vector<float> found(expected.size());
  ASSERT_EQ(simsense_buffer_read(handle, 2 * width * height, found.data(), found.size() * 4), KS_OK);
  EXPECT_EQ(found, expected);
  EXPECT_EQ(simsense_engine_submit(engine.get(), &desc, nullptr), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(simsense_engine_wait(engine.get(), nullptr), KS_ERROR_INVALID_ARGUMENT);
  sync.kind = 7;
  EXPECT_EQ(simsense_engine_wait(engine.get(), &sync), KS_ERROR_INVALID_ARGUMENT);
  sync.kind = KS_SYNC_TIMELINE;
  sync.value = 99;
  EXPECT_EQ(simsense_engine_wait(engine.get(), &sync), KS_ERROR_INVALID_ARGUMENT);
}

INSTANTIATE_TEST_SUITE_P(BackEnds, EngineSubmission,
                         testing::Values(std::pair{KS_SELECT_HOST, SIMSENSE_BACK_END_AUTO},
                                         std::pair{KS_SELECT_CPU, SIMSENSE_BACK_END_AUTO},
                                         std::pair{KS_SELECT_CPU, SIMSENSE_BACK_END_VULKAN}));
