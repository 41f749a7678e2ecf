// SPDX-License-Identifier: Apache-2.0
// The C API as the tests use it: RAII handles, and a compute call on packed host images.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "simsense/rig_samples.h"

namespace simsense_test {

template <class T, void (*release)(T)>
struct Release {
  void operator()(std::remove_pointer_t<T>* handle) const { release(handle); }
};
using Device = std::unique_ptr<simsense_device_t, Release<simsense_device, simsense_device_release>>;
using Buffer = std::unique_ptr<simsense_buffer_t, Release<simsense_buffer, simsense_buffer_release>>;
using EngineHandle = std::unique_ptr<simsense_engine_t, Release<simsense_engine, simsense_engine_release>>;

inline Device open_device(uint32_t select = KS_SELECT_HOST, uint32_t workers = 2) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = select;
  desc.worker_count = workers;
  simsense_device device = nullptr;
  if (simsense_device_create(&desc, &device) != KS_OK && select == KS_SELECT_HOST) ADD_FAILURE() << simsense_last_error();
  return Device(device);
}

inline Buffer make_buffer(const Device& device, uint64_t bytes, uint32_t flags = KS_BUFFER_HOST_VISIBLE) {
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(bytes, flags);
  simsense_buffer buffer = nullptr;
  EXPECT_EQ(simsense_buffer_create(device.get(), &create, &buffer), KS_OK) << simsense_last_error();
  return Buffer(buffer);
}

/// Both imagers with the same signal.
inline EngineHandle open_engine(const Device& device, const simsense_rig_desc& rig, const simsense_parameters& parameters,
                                const simsense_signal& signal = simsense_signal_init()) {
  simsense_engine engine = nullptr;
  EXPECT_EQ(simsense_engine_create(device.get(), &rig, &parameters, &engine), KS_OK) << simsense_last_error();
  EXPECT_EQ(simsense_engine_set_signal(engine, &signal, &signal), KS_OK) << simsense_last_error();
  return EngineHandle(engine);
}

/// On a host device of its own.
inline EngineHandle open_engine(const simsense_rig_desc& rig, const simsense_parameters& parameters,
                                const simsense_signal& signal = simsense_signal_init()) {
  return open_engine(open_device(), rig, parameters, signal);
}

/// The published fit to a D415 with the multiplicative part at 5 %.
inline simsense_signal noisy_signal() {
  simsense_signal s = simsense_signal_init();
  s.speckle_shape = 398.12f;
  s.speckle_scale = 0.00254f;
  s.black_level_dn = -0.231f;
  s.adc_noise_dn = 0.83f;
  return s;
}

template <class T>
constexpr uint32_t format_of = std::is_same_v<T, uint8_t>    ? KS_FORMAT_U8
                               : std::is_same_v<T, uint16_t> ? KS_FORMAT_U16
                                                             : KS_FORMAT_F32;

/// A packed host image; shape without its leading ones.
template <class T>
simsense_image host_image(const std::vector<T>& pixels, std::vector<uint64_t> shape, uint32_t format = format_of<T>) {
  simsense_image image{};
  image.host = const_cast<T*>(pixels.data());
  image.image = ks_image_desc_packed(format, static_cast<uint32_t>(shape.size()), shape.data());
  return image;
}

inline simsense_output_desc output_of(uint32_t output, const simsense_image& image) { return simsense_output_desc_init(output, image); }

/// The outputs must outlive it.
inline simsense_compute_desc request(const simsense_image& left, const simsense_image& right,
                                     const std::vector<simsense_output_desc>& outputs) {
  simsense_compute_desc desc = simsense_compute_desc_init();
  desc.left = left;
  desc.right = right;
  desc.outputs = outputs.data();
  desc.output_count = static_cast<uint32_t>(outputs.size());
  return desc;
}
inline ks_status compute(const EngineHandle& engine, const simsense_image& left, const simsense_image& right,
                         const std::vector<simsense_output_desc>& outputs) {
  const simsense_compute_desc desc = request(left, right, outputs);
  return simsense_engine_compute(engine.get(), &desc);
}

inline void expect_computed(const EngineHandle& engine, const simsense_image& left, const simsense_image& right,
                            const std::vector<simsense_output_desc>& outputs) {
  EXPECT_EQ(compute(engine, left, right, outputs), KS_OK) << simsense_last_error();
}

/// A pair of packed 8-bit images.
struct Pair {
  std::vector<uint8_t> left, right;
};

inline void expect_text(const std::string& wanted) {
  EXPECT_NE(std::string(simsense_last_error()).find(wanted), std::string::npos)
      << "wanted '" << wanted << "' in '" << simsense_last_error() << "'";
}
inline void expect_refused(ks_status status, const std::string& text) {
  EXPECT_EQ(status, KS_ERROR_INVALID_ARGUMENT) << text;
  expect_text(text);
}

/// One output of one pair of 8-bit images.
template <class T>
std::vector<T> compute_one(const EngineHandle& engine, uint32_t output, const Pair& pair, uint64_t height, uint64_t width,
                           std::vector<uint64_t> shape) {
  uint64_t count = 1;
  for (uint64_t n : shape) count *= n;
  std::vector<T> out(count, T(77));
  expect_computed(engine, host_image(pair.left, {height, width}), host_image(pair.right, {height, width}),
                  {output_of(output, host_image(out, shape))});
  return out;
}

}  // namespace simsense_test
