// SPDX-License-Identifier: Apache-2.0
// The engine gives the same outputs on either back end, in every format; on the caller's buffers without a copy, and asynchronously.
#include "engine/engine.h"
#include "image/view.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "capi/device/devices.h"
#include "capi/device/expect_error.h"
#include "device/error.h"
#include "signal/imager.h"
#include "simsense/match/stereo_pair.h"
#include "simsense/rig_samples.h"

namespace {

using simsense::ComputeRequest;
using simsense::Engine;
using simsense::ImageArgument;

constexpr uint32_t width = 64, height = 48, batch = 3, pixels = width * height, rgb_width = 83, rgb_height = 61;

const auto device = ks::test::shared_best_device;

simsense_parameters small_parameters() {
  simsense_parameters p = simsense_parameters_init();
  p.max_disparity = 32;
  p.block_width = p.block_height = 3;
  return p;
}

simsense_rig_desc with_batch(simsense_rig_desc rig) {
  rig.batch_count = batch;
  return rig;
}

simsense_rig_desc with_rgb(simsense_rig_desc rig, bool lens) {
  rig.rgb = simsense_test::camera(rgb_width, rgb_height, 60);
  if (lens) {
    const double coefficients[8] = {0.11, -0.3, 0.002, -0.001, 0, 0.05, -0.02, 0.01};
    std::copy_n(coefficients, 8, rig.rgb.lens.distortion);
  }
  simsense_test::set_pose(rig.left_to_rgb, 0.01, -0.02, 0.005, 0.015, 0.002, -0.003);
  return with_batch(rig);
}

simsense_rig_desc crooked() {
  simsense_rig_desc rig = simsense_test::crooked_rig(width, height, 43);
  rig.left.lens.distortion[5] = 0.08, rig.left.lens.distortion[6] = -0.03,
  rig.left.lens.distortion[7] = 0.01;  // a rational lens beside one of five
  return with_batch(rig);
}
simsense_rig_desc ideal() { return with_batch(simsense_test::ideal_rig(width, height, 43)); }

ImageArgument packed(void* host, uint32_t format, const std::vector<uint64_t>& shape = {batch, height, width}) {
  ImageArgument argument;
  argument.host = host;
  argument.image = ks_image_desc_packed(format, static_cast<uint32_t>(shape.size()), shape.data());
  return argument;
}

struct Images {
  std::vector<uint8_t> left, right, rgb;
  Images() {
    for (uint32_t n = 0; n < batch; ++n) {
      const StereoPair pair = random_dots(width, height, 4 + 3 * n, 10, n);
      left.insert(left.end(), pair.left.begin(), pair.left.end());
      right.insert(right.end(), pair.right.begin(), pair.right.end());
    }
    for (uint32_t i = 0; i < batch * rgb_width * rgb_height * 3; ++i) rgb.push_back(static_cast<uint8_t>(i * 31 % 251));
  }
};

struct Wanted {
  uint32_t output, format;
  bool operator==(const Wanted&) const = default;
};

std::vector<uint64_t> shape_of(uint32_t output, bool has_rgb) {
  const bool points = output == SIMSENSE_OUTPUT_POINTS || output == SIMSENSE_OUTPUT_POINTS_COLORED;
  const bool in_rgb = output == SIMSENSE_OUTPUT_DEPTH_RGB || (points && has_rgb);
  std::vector<uint64_t> shape{batch, in_rgb ? rgb_height : height, in_rgb ? rgb_width : width};
  if (points) shape.push_back(output == SIMSENSE_OUTPUT_POINTS ? 3 : 6);
  return shape;
}

simsense_rig_desc on_vulkan(simsense_rig_desc rig) {
  rig.back_end = SIMSENSE_BACK_END_VULKAN;
  return rig;
}

/// What the outputs hold, as numbers, one after the other.
using Maps = std::vector<std::vector<double>>;

Maps compute(Engine& engine, const Images& images, const std::vector<Wanted>& wanted, bool has_rgb) {
  std::vector<std::vector<std::byte>> memory;
  Images own = images;
  ComputeRequest request;
  request.left = packed(own.left.data(), KS_FORMAT_U8);
  request.right = packed(own.right.data(), KS_FORMAT_U8);
  if (has_rgb) request.rgb = packed(own.rgb.data(), KS_FORMAT_U8, {batch, rgb_height, rgb_width, 3});
  for (const Wanted& w : wanted) {
    uint64_t bytes = ks_format_bytes(w.format);
    for (const uint64_t n : shape_of(w.output, has_rgb)) bytes *= n;
    memory.emplace_back(bytes);
    request.outputs.push_back({w.output, packed(memory.back().data(), w.format, shape_of(w.output, has_rgb))});
  }
  engine.compute(request);
  Maps maps;
  for (size_t i = 0; i < wanted.size(); ++i) {
    const uint32_t format = wanted[i].format, bytes = ks_format_bytes(format);
    std::vector<double>& map = maps.emplace_back();
    for (size_t at = 0; at < memory[i].size(); at += bytes) {
      const simsense::ConstPlane element{memory[i].data() + at, 0, 0, format};
      map.push_back(format == KS_FORMAT_U8    ? element.at<uint8_t>(0, 0)
                    : format == KS_FORMAT_U16 ? element.at<uint16_t>(0, 0)
                    : format == KS_FORMAT_I16 ? element.at<int16_t>(0, 0)
                                              : static_cast<double>(element.at<float>(0, 0)));
    }
  }
  return maps;
}

/// Both back ends agree: whole numbers exactly, floats to `tolerance` (relative, of all but `share` of the elements). Returns the CPU's.
Maps compare(simsense_rig_desc rig, const simsense_parameters& p, const std::vector<Wanted>& wanted,
             const simsense_signal& signal = simsense_signal_init(), double tolerance = 0, double share = 0,
             const Images& images = Images()) {
  const bool has_rgb = rig.rgb.width != 0;
  Maps maps[2];
  for (const uint32_t back_end : {SIMSENSE_BACK_END_CPU, SIMSENSE_BACK_END_VULKAN}) {
    rig.back_end = back_end;
    Engine engine(device(), rig, p);
    engine.set_signal(signal, signal);
    maps[back_end - 1] = compute(engine, images, wanted, has_rgb);
  }
  for (size_t i = 0; i < wanted.size(); ++i) {
    size_t different = 0, nonzero = 0;
    for (size_t k = 0; k < maps[0][i].size(); ++k) {
      const double a = maps[0][i][k], b = maps[1][i][k];
      different += std::abs(a - b) > (wanted[i].format == KS_FORMAT_F32 ? tolerance * std::abs(a) : 0);
      nonzero += a > 0;
    }
    EXPECT_LE(static_cast<double>(different), share * static_cast<double>(maps[0][i].size())) << "output " << wanted[i].output;
    EXPECT_GT(nonzero, maps[0][i].size() / 100) << "output " << wanted[i].output << " is empty";
  }
  return maps[0];
}

const std::vector<Wanted> left_maps{{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32},     {SIMSENSE_OUTPUT_DEPTH, KS_FORMAT_F32},
                                    {SIMSENSE_OUTPUT_POINTS, KS_FORMAT_F32},        {SIMSENSE_OUTPUT_IR_LEFT, KS_FORMAT_U8},
                                    {SIMSENSE_OUTPUT_IR_RIGHT, KS_FORMAT_U8},       {SIMSENSE_OUTPUT_RECTIFIED_LEFT, KS_FORMAT_U8},
                                    {SIMSENSE_OUTPUT_RECTIFIED_RIGHT, KS_FORMAT_U8}};

const std::vector<Wanted> explained{
    {SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32}, {SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32}, {SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8}};

TEST(vulkan_engine, both_back_ends_give_the_same_maps) {
  compare(ideal(), small_parameters(), left_maps);
  compare(crooked(), small_parameters(), left_maps);
  compare(crooked(), small_parameters(), {{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_I16}, {SIMSENSE_OUTPUT_DEPTH, KS_FORMAT_U16}});
}

TEST(vulkan_engine, both_back_ends_register_alike) {
  const std::vector<Wanted> wanted{
      {SIMSENSE_OUTPUT_DEPTH_RGB, KS_FORMAT_F32}, {SIMSENSE_OUTPUT_POINTS, KS_FORMAT_F32}, {SIMSENSE_OUTPUT_POINTS_COLORED, KS_FORMAT_F32}};
  simsense_parameters p = small_parameters();
  compare(with_rgb(ideal(), false), p, wanted);
  p.splat_size = 4;
  compare(with_rgb(crooked(), true), p, wanted);
  p.splat_size = 1;
  p.depth_dilation = 1;
  compare(with_rgb(crooked(), true), p, {{SIMSENSE_OUTPUT_DEPTH_RGB, KS_FORMAT_I16}});
}

TEST(vulkan_engine, both_back_ends_have_the_published_faults) {
  simsense_rig_desc rig = crooked();
  rig.faults = SIMSENSE_FAULTS_PUBLISHED & ~SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED;
  compare(rig, small_parameters(), left_maps, simsense_signal_init(), 1e-6);
  compare(with_rgb(rig, false), small_parameters(), {{SIMSENSE_OUTPUT_DEPTH_RGB, KS_FORMAT_F32}}, simsense_signal_init(), 1e-6, 1e-2);
}

TEST(vulkan_engine, both_back_ends_clean_alike) {
  simsense_parameters p = small_parameters();
  p.uniqueness_ratio = 30;
  p.speckle_max_size = 40;
  for (const uint32_t filling : {SIMSENSE_HOLES_KEEP, SIMSENSE_HOLES_LEFT, SIMSENSE_HOLES_BACKGROUND}) {
    p.hole_filling = filling;
    compare(crooked(), p, {{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32}});
    compare(ideal(), p, {{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32}});
  }
}

TEST(vulkan_engine, both_back_ends_draw_the_same_noise) {
  const std::vector<Wanted> ir{{SIMSENSE_OUTPUT_IR_LEFT, KS_FORMAT_U8}, {SIMSENSE_OUTPUT_IR_RIGHT, KS_FORMAT_U8}};
  for (const char* preset : {"paper-d415", "d435"}) compare(ideal(), small_parameters(), ir, simsense::signal_preset(preset), 0, 1e-3);
  // A count that differs may change what is matched around it.
  compare(crooked(), small_parameters(), {{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32}}, simsense::signal_preset("sapien"), 1e-6, 0.02);
}

TEST(vulkan_engine, both_back_ends_explain_alike) {
  const std::vector<Wanted> wanted{{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32},
                                   {SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32},
                                   {SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8},
                                   {SIMSENSE_OUTPUT_DEPTH, KS_FORMAT_I16}};
  simsense_parameters p = small_parameters();
  p.uniqueness_ratio = 25;
  p.speckle_max_size = 30;
  p.max_depth_m = 0.4f;
  p.low_texture_dn = 100;
  p.edge_step_px = 1.5f;
  p.right_border_px = 6;
  compare(crooked(), p, wanted);
  simsense_signal bright = simsense_signal_init();
  bright.gain = 1.7f;
  compare(ideal(), p, wanted, bright);
}

TEST(vulkan_engine, both_back_ends_drop_what_is_blank_alike) {
  Images images;
  for (uint32_t i = 0; i < batch * pixels; ++i) {
    const uint32_t x = i % width, y = i % pixels / width;
    if (x < 40 && y < 36) images.left[i] = static_cast<uint8_t>(100 + (x + y) % 2);
  }
  simsense_parameters p = small_parameters();
  p.uniqueness_ratio = 0;
  p.lr_max_diff = -1;
  simsense_signal wide = simsense_signal_init();
  wide.bit_depth = 12;
  wide.gain = 3;
  for (const bool is_wide : {false, true}) {
    p.min_texture_dn = is_wide ? 4 : 2;
    const Maps maps = compare(ideal(), p, explained, is_wide ? wide : simsense_signal_init(), 0, 0, images);
    const auto blank = std::count(maps[2].begin(), maps[2].end(), SIMSENSE_REASON_LOW_TEXTURE);
    EXPECT_GT(blank, batch * 25 * 20);
    EXPECT_LT(blank, batch * 40 * 36);
  }
}

TEST(vulkan_engine, both_back_ends_match_a_region_alike) {
  simsense_parameters p = small_parameters();
  p.max_disparity = 16;
  p.hole_filling = SIMSENSE_HOLES_BACKGROUND;
  p.roi_x = 41, p.roi_y = 9, p.roi_width = 17, p.roi_height = 21;
  compare(crooked(), p, explained);
  p.roi_x = 0, p.roi_y = 0, p.roi_width = width, p.roi_height = height - 1;
  compare(ideal(), p, explained);
}

TEST(vulkan_engine, low_memory_gives_the_same_maps) {
  simsense_rig_desc rig = ideal();
  rig.low_memory = 1;
  simsense_parameters p = small_parameters();
  p.max_disparity = 16;
  compare(rig, p, {{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32}, {SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32}});
}

TEST(vulkan_engine, both_back_ends_match_more_than_8_bit_alike) {
  simsense_signal s = simsense_signal_init();
  s.bit_depth = 12;
  s.gain = 13.37f;
  simsense_parameters p = small_parameters();
  p.path_count = 8;
  p.census_kind = SIMSENSE_CENSUS_PLAIN;
  p.min_disparity = -3;
  p.p2_full_gradient_dn = 300;
  const std::vector<Wanted> wanted{{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_I16},
                                   {SIMSENSE_OUTPUT_IR_LEFT, KS_FORMAT_U16},
                                   {SIMSENSE_OUTPUT_RECTIFIED_RIGHT, KS_FORMAT_U16},
                                   {SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8}};
  compare(crooked(), p, wanted, s);
  compare(ideal(), p, wanted, s);
}

TEST(vulkan_engine, parameters_change_between_calls) {
  const simsense_rig_desc rig = on_vulkan(crooked());
  simsense_parameters p = small_parameters();
  const std::vector<Wanted> wanted{{SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32}, {SIMSENSE_OUTPUT_DEPTH, KS_FORMAT_F32}};
  Engine changing(device(), rig, p);
  const Maps before = compute(changing, Images(), wanted, false);
  p.p2 = 40;
  p.max_depth_m = 0.4f;
  p.roi_width = p.roi_height = 40;
  changing.set_parameters(p);
  Engine fresh(device(), rig, p);
  const Maps after = compute(changing, Images(), wanted, false);
  EXPECT_NE(before, after);
  EXPECT_EQ(after, compute(fresh, Images(), wanted, false));
}

/// Images of a batch in one buffer of the device.
ImageArgument in_buffer(uint32_t format, const void* data, std::vector<uint64_t> shape = {batch, height, width}) {
  ImageArgument argument = packed(nullptr, format, shape);
  uint64_t bytes = ks_format_bytes(format);
  for (const uint64_t n : shape) bytes *= n;
  argument.buffer = ks::Buffer::create(device(), bytes, 0);
  if (data) argument.buffer->write(0, data, bytes);
  return argument;
}

std::vector<float> floats_in(const ImageArgument& image) {
  std::vector<float> values(image.buffer->size_bytes() / 4);
  image.buffer->read(0, values.data(), values.size() * 4);
  return values;
}

ComputeRequest request_on_device(const Images& images) {
  ComputeRequest request;
  request.left = in_buffer(KS_FORMAT_U8, images.left.data());
  request.right = in_buffer(KS_FORMAT_U8, images.right.data());
  request.rgb = in_buffer(KS_FORMAT_U8, images.rgb.data(), {batch, rgb_height, rgb_width, 3});
  for (const uint32_t output : {SIMSENSE_OUTPUT_DEPTH, SIMSENSE_OUTPUT_DEPTH_RGB, SIMSENSE_OUTPUT_POINTS_COLORED})
    request.outputs.push_back({output, in_buffer(KS_FORMAT_F32, nullptr, shape_of(output, true))});
  return request;
}

TEST(vulkan_engine, device_buffers_are_used_without_a_copy) {
  const simsense_rig_desc rig = on_vulkan(with_rgb(crooked(), true));
  Engine engine(device(), rig, small_parameters());
  engine.set_signal(simsense::signal_preset("paper-d415"), simsense::signal_preset("d435"));
  const ComputeRequest request = request_on_device(Images());
  engine.compute(request);  // uploads the rig's tables
  const std::vector<float> first = floats_in(request.outputs[1].image);
  const uint64_t before = device()->copied_bytes();
  engine.compute(request);
  EXPECT_EQ(device()->copied_bytes(), before);
  EXPECT_EQ(first, floats_in(request.outputs[1].image));
  EXPECT_GT(*std::max_element(first.begin(), first.end()), 0.0f);
}

/// A call that is waited for gives what the submitted request gave.
void expect_as_alone(Engine& calm, const ComputeRequest& submitted, size_t which) {
  const ComputeRequest same = request_on_device(Images());
  calm.compute(same);
  for (size_t i = 0; i < same.outputs.size(); ++i)
    EXPECT_EQ(floats_in(same.outputs[i].image), floats_in(submitted.outputs[i].image)) << which;
}

TEST(vulkan_engine, submissions_run_one_after_the_other) {
  const simsense_rig_desc rig = on_vulkan(with_rgb(crooked(), true));
  simsense_parameters p = small_parameters();
  Engine engine(device(), rig, p), calm(device(), rig, p);
  engine.set_signal(simsense::signal_preset("paper-d415"), simsense::signal_preset("d435"));
  calm.set_signal(engine.signal(0), engine.signal(1));
  std::vector<ComputeRequest> requests;
  std::vector<ks_sync> syncs;
  for (uint64_t frame = 0; frame < 5; ++frame) {
    p.frame_index = frame;
    engine.set_parameters(p);
    requests.push_back(request_on_device(Images()));
    syncs.push_back(engine.submit(requests.back()));
    EXPECT_EQ(syncs.back().kind, KS_SYNC_TIMELINE);
  }
  EXPECT_FALSE(engine.wait(syncs[4], 0)) << "the last was begun just now";
  EXPECT_TRUE(engine.wait(syncs[2], UINT64_MAX));
  EXPECT_TRUE(engine.wait(syncs[4], UINT64_MAX));
  EXPECT_TRUE(engine.wait(syncs[0], UINT64_MAX));
  for (uint64_t frame = 0; frame < 5; ++frame) {
    p.frame_index = frame;
    calm.set_parameters(p);
    expect_as_alone(calm, requests[frame], frame);
  }
  ks_sync beyond = syncs[4];
  beyond.value = 6;
  EXPECT_THROW((void)engine.wait(beyond, 0), ks::Error);
  if (device()->info().capabilities & KS_CAP_TIMELINE_FD) {
    EXPECT_EQ(engine.export_timeline().value, 5u);
  } else {
    EXPECT_THROW((void)engine.export_timeline(), ks::Error);
  }
}

TEST(vulkan_engine, signals_change_between_submissions) {
  const simsense_rig_desc rig = on_vulkan(with_rgb(crooked(), false));
  Engine engine(device(), rig, small_parameters()), calm(device(), rig, small_parameters());
  std::vector<simsense_signal> signals(5, simsense::signal_preset("paper-d415"));
  signals[1].speckle_psf_sigma_px = 0.7f;
  signals[2].speckle_psf_sigma_px = 5;
  signals[3].full_well_e = 150, signals[3].blooming = 1;
  signals[4].bit_depth = 12;
  std::vector<ComputeRequest> requests;
  ks_sync last = ks_sync_init();
  for (const simsense_signal& signal : signals) {
    engine.set_signal(signals[0], signal);
    requests.push_back(request_on_device(Images()));
    last = engine.submit(requests.back());
  }
  EXPECT_TRUE(engine.wait(last, UINT64_MAX));
  for (size_t k = 0; k < signals.size(); ++k) {
    calm.set_signal(signals[0], signals[k]);
    expect_as_alone(calm, requests[k], k);
  }
}

TEST(vulkan_engine, images_beyond_an_index_are_refused) {
  simsense_rig_desc rig = on_vulkan(simsense_test::ideal_rig(32, 32, 43));
  rig.batch_count = (1u << 21) + 1;
  Engine engine(device(), rig, small_parameters());
  uint8_t never_read = 0;
  ComputeRequest request;
  request.left = request.right = packed(&never_read, KS_FORMAT_U8, {rig.batch_count, 32, 32});
  request.outputs.push_back({SIMSENSE_OUTPUT_REASON, request.left});
  EXPECT_ERROR(engine.compute(request), KS_ERROR_UNSUPPORTED, "left image spans 2147484672 elements");
}

TEST(vulkan_engine, a_cancelled_call_leaves_the_engine_as_it_was) {
  const simsense_rig_desc rig = on_vulkan(with_rgb(crooked(), true));
  Engine engine(device(), rig, small_parameters());
  engine.set_signal(simsense::signal_preset("paper-d415"), simsense::signal_preset("d435"));
  ComputeRequest request = request_on_device(Images());
  request.progress = [](void*, float) { return 1; };
  EXPECT_THROW(engine.compute(request), ks::Error);
  request.progress = nullptr;
  engine.compute(request);
  const std::vector<float> found = floats_in(request.outputs[0].image);
  Engine fresh(device(), rig, small_parameters());
  fresh.set_signal(engine.signal(0), engine.signal(1));
  fresh.compute(request);
  EXPECT_EQ(found, floats_in(request.outputs[0].image));
}

TEST(vulkan_engine, strided_host_images_keep_their_gaps) {
  const simsense_rig_desc rig = on_vulkan(ideal());
  Engine engine(device(), rig, small_parameters());
  const Maps expected = compute(engine, Images(), {{SIMSENSE_OUTPUT_DEPTH, KS_FORMAT_F32}}, false);
  Images images;
  std::vector<float> spaced(size_t{2} * batch * pixels, 77);  // every second column, rows from the last to the first
  ComputeRequest request;
  request.left = packed(images.left.data(), KS_FORMAT_U8);
  request.right = packed(images.right.data(), KS_FORMAT_U8);
  ImageArgument depth = packed(spaced.data(), KS_FORMAT_F32);
  depth.image.offset_bytes = uint64_t{2} * (height - 1) * width * 4;
  depth.image.byte_stride[0] = int64_t{2} * pixels * 4;
  depth.image.byte_stride[1] = -int64_t{2} * width * 4;
  depth.image.byte_stride[2] = 8;
  request.outputs = {{SIMSENSE_OUTPUT_DEPTH, depth}};
  engine.compute(request);
  for (size_t i = 0; i < batch * pixels; ++i) {
    const size_t n = i / pixels, y = i % pixels / width, x = i % width, at = 2 * (n * pixels + (height - 1 - y) * width + x);
    ASSERT_EQ(spaced[at], expected[0][i]) << i;
    ASSERT_EQ(spaced[at + 1], 77) << i;
  }
}

TEST(vulkan_engine, a_back_end_that_cannot_serve_is_refused) {
  simsense_rig_desc rig = on_vulkan(crooked());
  EXPECT_THROW(Engine(ks::test::host_device(), rig, small_parameters()), ks::Error);
  rig.back_end = 3;
  EXPECT_THROW(Engine(ks::test::host_device(), rig, small_parameters()), ks::Error);
  rig.back_end = SIMSENSE_BACK_END_AUTO;
  Engine chosen(ks::test::host_device(), rig, small_parameters());
  EXPECT_NO_THROW(compute(chosen, Images(), left_maps, false));
}

}  // namespace
