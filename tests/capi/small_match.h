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

/// A device, an engine and pairs of noise, the right one 5 pixels further left; as large as a SmallRender.
struct SmallMatch {
  static constexpr uint32_t width = 64, height = 64;
  simsense_device device;
  simsense_rig_desc rig = simsense_rig_desc_init();
  simsense_parameters parameters = simsense_parameters_init();
  simsense_engine engine = nullptr;
  ks_status status;  // of what was made
  std::vector<uint8_t> left, right;
  std::vector<float> disparity;
  simsense_output_desc output{};
  simsense_compute_desc desc = simsense_compute_desc_init();

  /// Takes the device over. `change`: of the rig, before the engine is made. may_fail: `status` is looked at.
  explicit SmallMatch(simsense_device on, uint32_t pairs = 1, void (*change)(simsense_rig_desc&) = nullptr, bool may_fail = false)
      : device(on), left(size_t{pairs} * width * height), right(left.size()), disparity(left.size()) {
    uint32_t state = 1;
    for (uint8_t& count : left) count = static_cast<uint8_t>((state = state * 1664525u + 1013904223u) >> 24);
    for (size_t i = 0; i < right.size(); ++i) right[i] = left[std::min(i + 5, left.size() - 1)];
    for (simsense_camera* camera : {&rig.left, &rig.right}) {
      camera->width = width, camera->height = height;
      camera->k[0] = camera->k[4] = 80, camera->k[2] = camera->k[5] = 31.5, camera->k[8] = 1;
    }
    rig.left_to_right[3] = -0.05;
    rig.rectified = 1, rig.batch_count = pairs;
    if (change != nullptr) change(rig);
    parameters.max_disparity = 32;
    status = simsense_engine_create(device, &rig, &parameters, &engine);
    EXPECT_TRUE(may_fail || status == KS_OK) << simsense_last_error();
    const uint64_t shape[3] = {pairs, height, width};
    simsense_image image{.buffer = nullptr, .host = disparity.data(), .image = ks_image_desc_packed(KS_FORMAT_F32, 3, shape)};
    output = simsense_output_desc_init(SIMSENSE_OUTPUT_DISPARITY, image);
    image.host = left.data(), image.image = ks_image_desc_packed(KS_FORMAT_U8, 3, shape);
    desc.left = desc.right = image;
    desc.right.host = right.data();
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
