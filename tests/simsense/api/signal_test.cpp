// SPDX-License-Identifier: Apache-2.0
// The imagers through the C API: bad parameters are refused with their numbers, the eyes differ as asked, batches split, more than 8 bits.
#include <algorithm>
#include <cmath>
#include <string>

#include "simsense/api/sensor.h"
#include "simsense/rig_samples.h"

using namespace simsense_test;

namespace {

constexpr uint32_t width = 160, height = 96;
const std::vector<uint64_t> shape{height, width};

std::vector<uint8_t> ramp(uint32_t images = 1) {
  std::vector<uint8_t> pixels(size_t{images} * width * height);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(20 + (i * 37) % 200);
  return pixels;
}

EngineHandle engine_with(const Device& device, const simsense_signal& left, const simsense_signal& right) {
  EngineHandle engine = open_engine(device, ideal_rig(width, height), small_parameters());
  EXPECT_EQ(simsense_engine_set_signal(engine.get(), &left, &right), KS_OK) << simsense_last_error();
  return engine;
}

template <class T>
std::vector<T> eye_of(const EngineHandle& engine, uint32_t output) {
  return compute_one<T>(engine, output, {ramp(), ramp()}, height, width, shape);
}

/// The batch's left images, views first_view on.
std::vector<uint8_t> views(const Device& device, uint32_t count, uint32_t first_view) {
  simsense_rig_desc rig = ideal_rig(width, height);
  rig.batch_count = count;
  simsense_signal signal = noisy_signal();
  signal.first_view = first_view;
  signal.prnu = 0.01f;
  const EngineHandle engine = open_engine(device, rig, small_parameters(), signal);
  const std::vector<uint8_t> same(size_t{count} * width * height, 100);
  std::vector<uint8_t> out(same.size());
  const simsense_image images = host_image(same, {count, height, width});
  EXPECT_EQ(compute(engine, images, images, {output_of(SIMSENSE_OUTPUT_IR_LEFT, host_image(out, {count, height, width}))}), KS_OK);
  return out;
}

}  // namespace

TEST(Signal, EachFaultIsRefusedWithItsNumberAndItsEye) {
  const Fault<simsense_signal> faults[] = {
      {"gain is -1", [](simsense_signal& s) { s.gain = -1; }},
      {"gain is inf", [](simsense_signal& s) { s.gain = INFINITY; }},
      {"exposure_s is -0.01", [](simsense_signal& s) { s.exposure_s = -0.01f; }},
      {"speckle_shape is nan", [](simsense_signal& s) { s.speckle_shape = NAN; }},
      {"speckle_scale is 0 with speckle_shape 3.98", [](simsense_signal& s) { s.speckle_shape = 3.98f; }},
      {"speckle_correlation is 1.5", [](simsense_signal& s) { s.speckle_correlation = 1.5f; }},
      {"speckle_psf_sigma_px is 17", [](simsense_signal& s) { s.speckle_psf_sigma_px = 17; }},
      {"speckle_psf_sigma_px is 0.05", [](simsense_signal& s) { s.speckle_psf_sigma_px = 0.05f; }},
      {"hot_pixel_share is 0.6", [](simsense_signal& s) { s.hot_pixel_share = 0.6f; }},
      {"dark_doubling_k is 0", [](simsense_signal& s) { s.dark_doubling_k = 0; }},
      {"temperature_c is -300", [](simsense_signal& s) { s.temperature_c = -300; }},
      {"doubles 50 times", [](simsense_signal& s) { s.temperature_c = 425; }},
      {"shot_noise is 101", [](simsense_signal& s) { s.shot_noise = 101; }},
      {"blooming is 0.5 with full_well_e 0", [](simsense_signal& s) { s.blooming = 0.5f; }},
      {"response_exponent is 0", [](simsense_signal& s) { s.response_exponent = 0; }},
      {"adc_noise_dn is -0.5", [](simsense_signal& s) { s.adc_noise_dn = -0.5f; }},
      {"black_level_dn is nan", [](simsense_signal& s) { s.black_level_dn = NAN; }},
      {"bit_depth is 7", [](simsense_signal& s) { s.bit_depth = 7; }},
      {"bit_depth is 17", [](simsense_signal& s) { s.bit_depth = 17; }},
  };
  const EngineHandle engine = open_engine(ideal_rig(width, height), small_parameters(), noisy_signal());
  const simsense_signal good = simsense_signal_init();
  for (const auto& fault : faults) {
    simsense_signal bad = simsense_signal_init();
    fault.make(bad);
    EXPECT_EQ(simsense_engine_set_signal(engine.get(), &good, &bad), KS_ERROR_INVALID_ARGUMENT) << fault.says;
    const std::string text = simsense_last_error();
    EXPECT_NE(text.find(std::string(fault.says)), std::string::npos) << "wanted '" << fault.says << "' in '" << text << "'";
    EXPECT_NE(text.find("right signal"), std::string::npos) << text;
  }
  EXPECT_EQ(simsense_engine_set_signal(engine.get(), &good, nullptr), KS_ERROR_INVALID_ARGUMENT);
  simsense_signal left = good, right = good;
  ASSERT_EQ(simsense_engine_get_signal(engine.get(), &left, &right), KS_OK);
  EXPECT_EQ(left.adc_noise_dn, noisy_signal().adc_noise_dn) << "a refused pair changed the engine";
}

TEST(Signal, PresetsAreKnownByNameAlone) {
  simsense_signal s = simsense_signal_init();
  ASSERT_EQ(simsense_signal_preset("neutral", &s), KS_OK);
  EXPECT_EQ(s.speckle_shape, 0);
  EXPECT_EQ(s.gain, 1);
  ASSERT_EQ(simsense_signal_preset("paper-d415", &s), KS_OK);
  EXPECT_EQ(s.speckle_shape, 3.98f);
  EXPECT_EQ(s.black_level_dn, -0.231f);
  ASSERT_EQ(simsense_signal_preset("sapien", &s), KS_OK);
  EXPECT_EQ(s.adc_noise_dn, 0.25f);
  ASSERT_EQ(simsense_signal_preset("d435", &s), KS_OK);
  EXPECT_EQ(s.conversion_gain_dn_per_e, 0.00497f);
  EXPECT_EQ(s.bit_depth, 8u);
  expect_refused(simsense_signal_preset("d999", &s), "neutral, paper-d415, sapien, d435");
  EXPECT_EQ(simsense_signal_preset(nullptr, &s), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(simsense_signal_preset("d435", nullptr), KS_ERROR_INVALID_ARGUMENT);
}

TEST(Signal, CountsAreTheAnalogueOnesRoundedAndBounded) {
  const Device device = open_device();
  simsense_signal s = simsense_signal_init();
  s.prnu = 0.02f, s.shot_noise = 1, s.read_noise_e = 3, s.full_well_e = 180, s.blooming = 0.4f, s.response_exponent = 1.2f;
  s.black_level_dn = 4;
  const auto counts = eye_of<uint8_t>(engine_with(device, simsense_signal_init(), s), SIMSENSE_OUTPUT_IR_RIGHT);
  const auto pixels = ramp();
  const std::vector<float> light(pixels.begin(), pixels.end());
  std::vector<float> dn(light.size());
  ASSERT_EQ(simsense_signal_analogue(&s, light.data(), width, height, 0, 0, 1, dn.data()), KS_OK) << simsense_last_error();
  for (size_t i = 0; i < dn.size(); ++i) ASSERT_EQ(counts[i], std::nearbyint(std::clamp(dn[i], 0.0f, 255.0f))) << i;
}

TEST(Signal, AnalogueCountsRefuseWhatCannotBe) {
  simsense_signal s = simsense_signal_init();
  float value = 1;
  EXPECT_EQ(simsense_signal_analogue(&s, nullptr, 1, 1, 0, 0, 0, &value), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(simsense_signal_analogue(&s, &value, 0, 1, 0, 0, 0, &value), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(simsense_signal_analogue(&s, &value, 1, 1, 0, 0, 2, &value), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(simsense_signal_analogue(&s, &value, 1u << 20, 1u << 20, 0, 0, 0, &value), KS_ERROR_INVALID_ARGUMENT);
  s.blooming = 0.5f;
  expect_refused(simsense_signal_analogue(&s, &value, 1, 1, 0, 0, 0, &value), "blooming");
}

TEST(Signal, UnequalImagersAreThePairsMismatch) {
  const Device device = open_device();
  simsense_signal left = simsense_signal_init(), right = left;
  right.gain = 1.06f;
  right.black_level_dn = 3;
  const EngineHandle engine = engine_with(device, left, right);
  const auto a = eye_of<uint8_t>(engine, SIMSENSE_OUTPUT_IR_LEFT), b = eye_of<uint8_t>(engine, SIMSENSE_OUTPUT_IR_RIGHT);
  EXPECT_EQ(a, ramp());
  const EngineHandle noisy = engine_with(device, noisy_signal(), noisy_signal());
  EXPECT_NE(eye_of<uint8_t>(noisy, SIMSENSE_OUTPUT_IR_LEFT), eye_of<uint8_t>(noisy, SIMSENSE_OUTPUT_IR_RIGHT)) << "noise of their own";
  for (size_t i = 0; i < a.size(); ++i) ASSERT_EQ(b[i], std::lrint(1.06f * static_cast<float>(a[i]) + 3)) << i;
}

TEST(Signal, ABatchMayBeSplit) {
  const Device device = open_device();
  const auto whole = views(device, 4, 0);
  auto parts = views(device, 3, 0);
  const auto last = views(device, 1, 3);
  parts.insert(parts.end(), last.begin(), last.end());
  EXPECT_EQ(whole, parts);
  EXPECT_NE(views(device, 1, 0), last);
}

TEST(Signal, TwelveBitsComeOutWholeAndTheMatcherSeesThem) {
  const Device device = open_device();
  simsense_signal wide = simsense_signal_init();
  wide.bit_depth = 12;
  wide.gain = 15.7f;
  const EngineHandle engine = engine_with(device, wide, wide);
  const auto counts = eye_of<uint16_t>(engine, SIMSENSE_OUTPUT_IR_LEFT);
  const auto seen = eye_of<uint16_t>(engine, SIMSENSE_OUTPUT_RECTIFIED_LEFT);
  const auto input = ramp();
  for (size_t i = 0; i < counts.size(); ++i) {
    ASSERT_EQ(counts[i], std::lrint(15.7f * static_cast<float>(input[i])));
    ASSERT_EQ(seen[i], counts[i]);
  }
  std::vector<uint8_t> narrow(input.size());
  const simsense_image image = host_image(input, shape);
  expect_refused(compute(engine, image, image, {output_of(SIMSENSE_OUTPUT_IR_LEFT, host_image(narrow, shape))}), "u16");
}
