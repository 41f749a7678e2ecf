// SPDX-License-Identifier: Apache-2.0
// A small match over the C API, for tests of what may happen around it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "simsense/simsense.h"

namespace ks::test {

inline simsense_device open_host_device() {
  ks_device_desc host = ks_device_desc_init();
  host.select = KS_SELECT_HOST;
  host.worker_count = 2;
  simsense_device device = nullptr;
  EXPECT_EQ(simsense_device_create(&host, &device), KS_OK) << simsense_last_error();
  return device;
}

/// A device, an engine and a pair of noise, the right one 5 pixels further left.
struct SmallMatch {
  static constexpr uint32_t width = 96, height = 64;
  simsense_device device;
  simsense_engine engine = nullptr;
  std::vector<uint8_t> left, right;
  std::vector<float> depth;
  simsense_output_desc output{};
  simsense_compute_desc desc = simsense_compute_desc_init();

  /// Takes the device over.
  explicit SmallMatch(simsense_device on) : device(on), left(width * height), right(width * height), depth(width * height) {
    uint32_t state = 1;
    for (uint8_t& count : left) count = static_cast<uint8_t>((state = state * 1664525u + 1013904223u) >> 24);
    for (size_t i = 0; i < right.size(); ++i) right[i] = left[std::min(i + 5, left.size() - 1)];
    simsense_rig_desc rig = simsense_rig_desc_init();
    for (simsense_camera* camera : {&rig.left, &rig.right}) {
      camera->width = width, camera->height = height;
      camera->k[0] = camera->k[4] = 80, camera->k[2] = 47.5, camera->k[5] = 31.5, camera->k[8] = 1;
    }
    rig.left_to_right[3] = -0.05;
    rig.rectified = 1;
    simsense_parameters parameters = simsense_parameters_init();
    parameters.max_disparity = 32;
    EXPECT_EQ(simsense_engine_create(device, &rig, &parameters, &engine), KS_OK) << simsense_last_error();
    const uint64_t shape[2] = {height, width};
    const simsense_image out{.buffer = nullptr, .host = depth.data(), .image = ks_image_desc_packed(KS_FORMAT_F32, 2, shape)};
    output = simsense_output_desc_init(SIMSENSE_OUTPUT_DEPTH, out);
    desc.left = {.buffer = nullptr, .host = left.data(), .image = ks_image_desc_packed(KS_FORMAT_U8, 2, shape)};
    desc.right = {.buffer = nullptr, .host = right.data(), .image = ks_image_desc_packed(KS_FORMAT_U8, 2, shape)};
    desc.outputs = &output, desc.output_count = 1;
  }
  ~SmallMatch() {
    simsense_engine_release(engine);
    simsense_device_release(device);
  }
  SmallMatch(const SmallMatch&) = delete;
  SmallMatch& operator=(const SmallMatch&) = delete;
};

}  // namespace ks::test
