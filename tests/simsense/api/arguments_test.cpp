// SPDX-License-Identifier: Apache-2.0
// Each bad argument gives KS_ERROR_INVALID_ARGUMENT, and a text that holds the offending number.
#include <cmath>

#include "simsense/api/sensor.h"
#include "simsense/rig_samples.h"

using namespace simsense_test;

namespace {

constexpr uint32_t width = 64, height = 48;

simsense_parameters fitting() {
  simsense_parameters p = simsense_parameters_init();
  p.max_disparity = 16;
  return p;
}

struct Compute {
  std::vector<uint8_t> pixels = std::vector<uint8_t>(width * height, 40);
  std::vector<float> depth = std::vector<float>(width * height);
  simsense_image left = host_image(pixels, {height, width}), right = left, left_laser{}, right_laser{};
  simsense_output_desc output = output_of(SIMSENSE_OUTPUT_DEPTH, host_image(depth, {height, width}));

  ks_status run(const EngineHandle& engine) const {
    const std::vector outputs{output};
    simsense_compute_desc desc = request(left, right, outputs);
    desc.left_laser = left_laser;
    desc.right_laser = right_laser;
    return simsense_engine_compute(engine.get(), &desc);
  }
};

}  // namespace

TEST(Parameters, EachFaultIsRefusedWithItsNumber) {
  const Fault<simsense_parameters> faults[] = {
      {"census window is 6x7", [](simsense_parameters& p) { p.census_width = 6; }},
      {"census window is 9x9", [](simsense_parameters& p) { p.census_width = p.census_height = 9; }},
      {"census window is 1x1", [](simsense_parameters& p) { p.census_width = p.census_height = 1; }},
      {"census window is 0x7", [](simsense_parameters& p) { p.census_width = 0; }},
      {"census window is 4294967295x4294967295", [](simsense_parameters& p) { p.census_width = p.census_height = UINT32_MAX; }},
      {"max_disparity is 15", [](simsense_parameters& p) { p.max_disparity = 15; }},
      {"max_disparity is 1025", [](simsense_parameters& p) { p.max_disparity = 1025; }},
      {"block is 17x17", [](simsense_parameters& p) { p.block_width = p.block_height = 17; }},
      {"block is 7x2", [](simsense_parameters& p) { p.block_height = 2; }},
      {"p1 is 0", [](simsense_parameters& p) { p.p1 = 0; }},
      {"p1 is 32, p2 is 32", [](simsense_parameters& p) { p.p1 = 32; }},
      {"p2 is 224", [](simsense_parameters& p) { p.p2 = 224; }},
      {"uniqueness_ratio is 101", [](simsense_parameters& p) { p.uniqueness_ratio = 101; }},
      {"lr_max_diff is -2", [](simsense_parameters& p) { p.lr_max_diff = -2; }},
      {"median_size is 9", [](simsense_parameters& p) { p.median_size = 9; }},
      {"subpixel is 77", [](simsense_parameters& p) { p.subpixel = 77; }},
      {"min_depth_m is -1", [](simsense_parameters& p) { p.min_depth_m = -1; }},
      {"max_depth_m is 0.5, min_depth_m is 0.5", [](simsense_parameters& p) { p.min_depth_m = p.max_depth_m = 0.5f; }},
      {"max_depth_m is nan", [](simsense_parameters& p) { p.max_depth_m = NAN; }},
      {"census_kind is 77", [](simsense_parameters& p) { p.census_kind = 77; }},
      {"census_contrast is 1.5", [](simsense_parameters& p) { p.census_contrast = 1.5f; }},
      {"census_contrast is nan", [](simsense_parameters& p) { p.census_contrast = NAN; }},
      {"min_disparity is -2000", [](simsense_parameters& p) { p.min_disparity = -2000; }},
      {"path_count is 5", [](simsense_parameters& p) { p.path_count = 5; }},
      {"speckle_max_diff_px is -1", [](simsense_parameters& p) { p.speckle_max_diff_px = -1; }},
      {"hole_filling is 77", [](simsense_parameters& p) { p.hole_filling = 77; }},
      {"splat_size is 16", [](simsense_parameters& p) { p.splat_size = 16; }},
      {"at most 65535",
       [](simsense_parameters& p) {
         p.census_kind = SIMSENSE_CENSUS_PLAIN, p.census_width = 9, p.p2 = 223;
         p.block_width = 15, p.block_height = 17;
       }},
      {"roi", [](simsense_parameters& p) { p.roi_x = 60, p.roi_width = 50, p.roi_height = 30; }},
  };
  const Device device = open_device();
  const EngineHandle engine = open_engine(device, ideal_rig(width, height), fitting());
  for (const auto& fault : faults) {
    simsense_parameters p = fitting();
    fault.make(p);
    expect_refused(simsense_engine_set_parameters(engine.get(), &p), fault.says);
    const simsense_rig_desc rig = ideal_rig(width, height);
    simsense_engine none = nullptr;
    EXPECT_EQ(simsense_engine_create(device.get(), &rig, &p, &none), KS_ERROR_INVALID_ARGUMENT) << fault.says;
    EXPECT_EQ(none, nullptr);
  }
  EXPECT_EQ(Compute().run(engine), KS_OK) << simsense_last_error();
}

TEST(Parameters, TheLimitsThemselvesAreAccepted) {
  void (*const limits[])(simsense_parameters&) = {
      [](simsense_parameters& p) { p.max_disparity = 1024; },
      [](simsense_parameters& p) { p.census_width = 13, p.census_height = 5; },
      [](simsense_parameters& p) { p.census_width = 65, p.census_height = 1; },
      [](simsense_parameters& p) { p.census_width = 1, p.census_height = 3; },
      [](simsense_parameters& p) { p.block_width = 17, p.block_height = 15; },
      [](simsense_parameters& p) { p.block_width = 255, p.block_height = 1, p.p1 = 222, p.p2 = 223; },
      [](simsense_parameters& p) { p.block_width = p.block_height = 1, p.p1 = 1, p.p2 = 2; },
      [](simsense_parameters& p) { p.uniqueness_ratio = 100, p.lr_max_diff = 0, p.median_size = 7; },
      [](simsense_parameters& p) { p.uniqueness_ratio = 0, p.lr_max_diff = -1, p.median_size = 1, p.subpixel = SIMSENSE_SUBPIXEL_NONE; },
      [](simsense_parameters& p) { p.max_depth_m = INFINITY; },
  };
  for (const auto& make : limits) {
    simsense_parameters p = fitting();
    make(p);
    const EngineHandle engine = open_engine(ideal_rig(33, 32), p);
    std::vector<uint8_t> image(33 * 32);
    for (size_t i = 0; i < image.size(); ++i) image[i] = static_cast<uint8_t>(i * 2654435761u >> 13);
    const auto depth = compute_one<float>(engine, SIMSENSE_OUTPUT_DEPTH, {image, image}, 32, 33, {32, 33});
    for (float z : depth) EXPECT_TRUE(z >= 0 && z < p.max_depth_m);
  }
}

TEST(ComputeArguments, EachFaultIsRefusedWithItsNumber) {
  const Fault<Compute> faults[] = {
      {"left image has shape [48, 63]", [](Compute& c) { c.left.image.shape[1] = 63; }},
      {"right image has shape [48]", [](Compute& c) { c.right.image.dim_count = 1; }},
      {"right image has 9 dimensions", [](Compute& c) { c.right.image.dim_count = 9; }},
      {"left image has format 4", [](Compute& c) { c.left.image.format = KS_FORMAT_U32; }},
      {"right image has format 99", [](Compute& c) { c.right.image.format = 99; }},
      {"byte_stride[0] is 0", [](Compute& c) { c.left.image.byte_stride[0] = 0; }},
      {"byte_stride[1] is 9223372036854775807", [](Compute& c) { c.left.image.byte_stride[1] = INT64_MAX; }},
      {"left image has neither", [](Compute& c) { c.left.host = nullptr; }},
      {"struct type 0x0", [](Compute& c) { c.left.image.header.type = 0; }},
      {"output 12 is unknown", [](Compute& c) { c.output.output = 12; }},
      {"output 0 is unknown", [](Compute& c) { c.output.output = 0; }},
      {"output 3 (depth_rgb) needs a rig with an rgb camera", [](Compute& c) { c.output.output = SIMSENSE_OUTPUT_DEPTH_RGB; }},
      {"output 4 (ir_left) has format 6", [](Compute& c) { c.output.output = SIMSENSE_OUTPUT_IR_LEFT; }},
      {"points has shape [48, 64], must be [1, 48, 64, 3]", [](Compute& c) { c.output.output = SIMSENSE_OUTPUT_POINTS; }},
      {"depth has neither", [](Compute& c) { c.output.image.host = nullptr; }},
      {"for the left camera alone", [](Compute& c) { c.left_laser = c.left; }},
      {"for the right camera alone", [](Compute& c) { c.right_laser = c.right; }},
      {"right laser image has shape [47, 64]",
       [](Compute& c) { c.left_laser = c.right_laser = c.left, c.right_laser.image.shape[0] = 47; }},
      {"left laser image has format 4",
       [](Compute& c) { c.left_laser = c.right_laser = c.left, c.left_laser.image.format = KS_FORMAT_U32; }},
  };
  const EngineHandle engine = open_engine(ideal_rig(width, height), fitting());
  for (const auto& fault : faults) {
    Compute call;
    fault.make(call);
    expect_refused(call.run(engine), fault.says);
  }
  const Compute call;
  expect_refused(compute(engine, call.left, call.right, {}), "output_count is 0");
  expect_refused(compute(engine, call.left, call.right, {call.output, call.output}), "output 2 (depth) is listed twice");
  EXPECT_EQ(call.run(engine), KS_OK) << simsense_last_error();
}

TEST(ComputeArguments, DisparitiesThatSixteenthsCannotHoldAreRefused) {
  simsense_parameters p = fitting();
  p.max_disparity = 32;
  for (const int32_t last : {2047, 2048}) {
    p.min_disparity = last - 31;
    const EngineHandle engine = open_engine(ideal_rig(width, height), p);
    Compute call;
    call.output.output = SIMSENSE_OUTPUT_DISPARITY;
    EXPECT_EQ(call.run(engine), KS_OK) << simsense_last_error();
    const uint64_t shape[] = {height, width};
    call.output.image.image = ks_image_desc_packed(KS_FORMAT_I16, 2, shape);
    EXPECT_EQ(call.run(engine), last > 2047 ? KS_ERROR_INVALID_ARGUMENT : KS_OK) << last;
    if (last > 2047) expect_text("disparities reach 2048 pixels: in int16 sixteenths at most 2047");
  }
}

/// NULL and strangers in a handle's place: capi/every_function_test.cpp.
TEST(EngineArguments, WrongStructsAndMirroredRigsAreRefused) {
  const Device device = open_device();
  const simsense_rig_desc rig = ideal_rig(width, height);
  const simsense_parameters parameters = fitting();
  simsense_engine engine = nullptr;
  simsense_rig_desc foreign = rig;
  foreign.header.type = SIMSENSE_TYPE_PARAMETERS;
  expect_refused(simsense_engine_create(device.get(), &foreign, &parameters, &engine), "0x2002");
  simsense_rig_desc mirrored = rig;
  mirrored.left_to_right[3] = 0.05;
  expect_refused(simsense_engine_create(device.get(), &mirrored, &parameters, &engine), "0.05 m");
  EXPECT_EQ(engine, nullptr);
  simsense_engine_release(nullptr);
}
