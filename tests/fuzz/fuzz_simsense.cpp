// SPDX-License-Identifier: Apache-2.0
// Bytes as a sequence of calls of simsense's C interface, with handles that are NULL, foreign or released, absurd sizes, and numbers that
// are none: each gives a status or its result. Pointers are right, and arrays are as long as they are said to be: C can check neither.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include "handles.h"
#include "simsense/simsense.h"

namespace {

constexpr uint32_t width = 40, height = 33, most_outputs = 3;
constexpr uint64_t image_bytes = uint64_t{64} * 64 * 6 * 4 * 2;

simsense_device open_device() {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_HOST;
  desc.worker_count = 1;
  simsense_device device = nullptr;
  if (simsense_device_create(&desc, &device) != KS_OK) std::abort();
  return device;
}

class Calls {
 public:
  Calls(simsense_device device, const uint8_t* data, size_t size)
      : device_(device), bytes_(data, size), memory_(image_bytes * (5 + most_outputs)) {}
  void run() {
    create_engine(true);
    for (int n = 0; n < 24 && !bytes_.empty(); ++n) call();
  }

 private:
  void call() {
    static constexpr void (Calls::*kinds[])() = {&Calls::create_any_engine, &Calls::set_parameters, &Calls::set_signal,
                                                 &Calls::about_handles,     &Calls::about_results,  &Calls::compute,
                                                 &Calls::compute,           &Calls::compute};
    (this->*kinds[bytes_.below(8)])();
  }

  simsense_device device() { return bytes_.below(16) == 0 ? nullptr : device_; }
  simsense_engine engine() { return bytes_.below(8) > 0 ? engines_.latest() : engines_.pick(bytes_, device_); }
  template <class T>
  const T* or_null(const T& value) {
    return bytes_.below(32) == 0 ? nullptr : &value;
  }
  simsense_parameters parameters() {
    simsense_parameters parameters = simsense_parameters_init();
    parameters.max_disparity = 16;
    bytes_.disturb(parameters);
    return parameters;
  }
  /// Images larger than this test's memory are asked for by no call that would be obeyed.
  static void fit(simsense_camera& camera) {
    if (camera.width > 64 && camera.width < 1u << 20) camera.width = 64;
    if (camera.height > 64 && camera.height < 1u << 20) camera.height = 64;
  }

  void create_any_engine() { create_engine(false); }
  void create_engine(bool plain) {
    simsense_rig_desc rig = simsense_rig_desc_init();
    for (simsense_camera* camera : {&rig.left, &rig.right}) {
      camera->width = width, camera->height = height;
      camera->k[0] = camera->k[4] = 40, camera->k[2] = 19.5, camera->k[5] = 16, camera->k[8] = 1;
    }
    rig.left_to_right[3] = -0.05;
    rig.rectified = plain || bytes_.below(2) > 0;
    if (!plain) {
      if (bytes_.below(2) > 0) rig.rgb = rig.left;
      bytes_.disturb(rig);
      if (rig.batch_count > 2 && rig.batch_count < 1u << 28) rig.batch_count = 2;
      if (rig.back_end == SIMSENSE_BACK_END_VULKAN) rig.back_end = SIMSENSE_BACK_END_CPU;
    }
    fit(rig.left), fit(rig.right), fit(rig.rgb);
    const simsense_parameters known = plain ? simsense_parameters_init() : parameters();
    (void)simsense_engine_create(plain ? device_ : device(), plain ? &rig : or_null(rig), plain ? &known : or_null(known), engines_.out());
    engines_.keep();
    if (plain) (void)simsense_engine_set_parameters(engines_.latest(), &known);
  }

  void set_parameters() {
    simsense_parameters known = parameters();
    (void)simsense_engine_set_parameters(engine(), or_null(known));
    (void)simsense_engine_get_parameters(engine(), &known);
  }

  void set_signal() {
    static constexpr const char* presets[] = {"neutral", "paper-d415", "sapien", "d435", "", "x"};
    simsense_signal left = simsense_signal_init(), right = simsense_signal_init();
    if (bytes_.below(4) == 0) (void)simsense_signal_preset(bytes_.below(8) == 0 ? nullptr : presets[bytes_.below(6)], &left);
    bytes_.disturb(left), bytes_.disturb(right);
    (void)simsense_engine_set_signal(engine(), or_null(left), or_null(right));
    (void)simsense_engine_get_signal(engine(), &left, nullptr);
    const std::vector<float> light(64, 9.0f);
    std::vector<float> dn(light.size());
    (void)simsense_signal_analogue(or_null(left), bytes_.below(8) == 0 ? nullptr : light.data(), bytes_.below(9), bytes_.below(9),
                                   bytes_.below(3), bytes_.below(3), bytes_.below(3), dn.data());
  }

  void about_handles() {
    switch (bytes_.below(4)) {
      case 0:
        return engines_.retain_or_release(bytes_);
      case 1:
        return buffers_.retain_or_release(bytes_);
      case 2: {
        ks_buffer_create_desc create = ks_buffer_create_desc_init(bytes_.size() * 64, bytes_.below(4));
        if (create.size_bytes > image_bytes && create.size_bytes < uint64_t{1} << 45) create.size_bytes = image_bytes;
        (void)simsense_buffer_create(device(), or_null(create), buffers_.out());
        return buffers_.keep();
      }
      default: {
        ks_buffer_desc desc = ks_buffer_desc_init();
        desc.memory = KS_MEMORY_HOST;
        desc.allocation_bytes = desc.size_bytes = image_bytes;
        bytes_.disturb(desc);
        desc.handle = desc.memory == KS_MEMORY_HOST ? reinterpret_cast<uint64_t>(memory_.data()) : UINT64_MAX;
        desc.allocation_bytes = std::min(desc.allocation_bytes, image_bytes);
        (void)simsense_buffer_import(device(), or_null(desc), buffers_.out());
        return buffers_.keep();
      }
    }
  }

  void about_results() {
    uint64_t count = 0;
    uint32_t capacity = bytes_.below(4);
    std::array<double, 16> k{}, pose{};
    std::array<ks_stage_time, 4> times{};
    ks_sync sync = ks_sync_init();
    switch (bytes_.below(6)) {
      case 0:
        (void)simsense_engine_get_rectified(engine(), k.data(), nullptr, pose.data());
        break;
      case 1:
        (void)simsense_engine_get_stage_times(engine(), times.data(), &capacity);
        break;
      case 2:
        bytes_.disturb(sync), (void)simsense_engine_wait(engine(), or_null(sync));
        break;
      case 3:
        (void)simsense_engine_export_timeline(engine(), &sync);
        break;
      case 4:
        (void)simsense_device_allocated_bytes(device(), &count), (void)simsense_device_copied_bytes(device(), &count);
        break;
      default: {
        const auto type = static_cast<uint32_t>(bytes_.below(2) > 0 ? 0x2000 + bytes_.below(8) : bytes_.size());
        (void)simsense_struct_init(type, memory_.data(), static_cast<uint32_t>(std::min<uint64_t>(bytes_.size() * 8, image_bytes)));
      }
    }
  }

  /// The image that most engines here expect, or another one, in host memory of its own or in a buffer.
  simsense_image image(uint32_t format, uint32_t components, size_t place) {
    const uint64_t shape[3] = {height, width, components};
    simsense_image image{};
    image.image = ks_image_desc_packed(format, components == 1 ? 2 : 3, shape);
    if (bytes_.below(8) == 0) {
      bytes_.disturb(image.image);
      // Host memory has no size that could be checked: what lies outside is not asked for, except in a buffer.
      image.buffer = buffers_.pick(bytes_, device_);
      image.host = image.buffer == nullptr ? nullptr : memory_.data();
    } else if (bytes_.below(16) > 0) {
      image.host = memory_.data() + place * image_bytes;
    }
    return image;
  }

  void compute() {
    static constexpr uint32_t inputs[] = {KS_FORMAT_U8, KS_FORMAT_U16, KS_FORMAT_F32};
    std::array<simsense_output_desc, most_outputs> outputs{};
    for (uint32_t i = 0; i < most_outputs; ++i) {
      const uint32_t output = bytes_.below(13);
      const bool bytewise =
          output == SIMSENSE_OUTPUT_IR_LEFT || output == SIMSENSE_OUTPUT_RECTIFIED_LEFT || output == SIMSENSE_OUTPUT_REASON;
      const uint32_t components = output == SIMSENSE_OUTPUT_POINTS ? 3 : output == SIMSENSE_OUTPUT_POINTS_COLORED ? 6 : 1;
      outputs[i] = simsense_output_desc_init(output, image(bytewise ? KS_FORMAT_U8 : KS_FORMAT_F32, components, 5 + i));
    }
    for (size_t n = 0; n < 64; ++n) memory_[bytes_.byte() * 37 % memory_.size()] = bytes_.byte();
    const uint32_t format = inputs[bytes_.below(3)];
    simsense_compute_desc desc = simsense_compute_desc_init();
    desc.left = image(format, 1, 0), desc.right = image(format, 1, 1);
    if (bytes_.below(8) == 0) desc.left_laser = image(format, 1, 2), desc.right_laser = image(format, 1, 3);
    if (bytes_.below(8) == 0) desc.rgb = image(KS_FORMAT_U8, 3, 4);
    desc.outputs = or_null(outputs[0]), desc.output_count = bytes_.below(most_outputs + 1);
    int questions = bytes_.byte();
    desc.progress_user = &questions;
    if (bytes_.below(4) == 0) desc.progress = [](void* left, float) { return static_cast<int>(--*static_cast<int*>(left) < 0); };
    ks_sync sync = ks_sync_init();
    if (bytes_.below(2) > 0)
      (void)simsense_engine_compute(engine(), or_null(desc));
    else if (simsense_engine_submit(engine(), or_null(desc), &sync) == KS_OK)
      (void)simsense_engine_wait(engines_.latest(), &sync);
  }

  simsense_device device_;
  Bytes bytes_;
  std::vector<unsigned char> memory_;
  Handles<simsense_buffer, simsense_buffer_retain, simsense_buffer_release> buffers_;
  Handles<simsense_engine, simsense_engine_retain, simsense_engine_release> engines_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const simsense_device device = open_device();
  Calls(device, data, size).run();
  return 0;
}
