// SPDX-License-Identifier: Apache-2.0
// The engine's part of simsense's C API: structs are read, handles become objects, and the pipeline runs.
#include "engine/engine.h"

#include <algorithm>
#include <cstring>

#include "api/handles.h"
#include "api/struct_table.h"
#include "cpu/signal/imager.h"
#include "device/struct_read.h"
#include "device/struct_table.h"
#include "device/thread_pool.h"
#include "signal/imager.h"
#include "simsense/simsense.h"

namespace {

simsense_parameters read_parameters(const simsense_parameters* parameters) {
  return ks::read_struct(parameters, SIMSENSE_TYPE_PARAMETERS, "parameters");
}

simsense::ImageArgument read_image(const simsense_image& image, const char* name) {
  simsense::ImageArgument argument;
  if (image.buffer) argument.buffer = ks::object_of(image.buffer, name);
  argument.host = image.host;
  ks::check_embedded(image.image, KS_TYPE_IMAGE_DESC, name);
  argument.image = image.image;
  return argument;
}

std::vector<simsense::ComputeRequest::Output> read_outputs(const simsense_output_desc* outputs, uint32_t count) {
  std::vector<simsense::ComputeRequest::Output> read;
  for (uint32_t i = 0; i < count; ++i) {
    const std::string name = "outputs[" + std::to_string(i) + "]";
    const simsense_output_desc output = ks::read_element(outputs, i, SIMSENSE_TYPE_OUTPUT_DESC, name.c_str());
    read.push_back({output.output, read_image(output.image, name.c_str())});
  }
  return read;
}

bool is_given(const simsense_image& image) { return image.buffer || image.host; }

simsense::ComputeRequest read_request(const simsense::Engine& engine, const simsense_compute_desc* desc) {
  const auto known = ks::read_struct(desc, SIMSENSE_TYPE_COMPUTE_DESC, "compute desc");
  simsense::ComputeRequest request;
  request.left = read_image(known.left, "left image");
  request.right = read_image(known.right, "right image");
  if (is_given(known.left_laser)) request.lasers[0] = read_image(known.left_laser, "left laser image");
  if (is_given(known.right_laser)) request.lasers[1] = read_image(known.right_laser, "right laser image");
  if (is_given(known.rgb)) request.rgb = read_image(known.rgb, "rgb image");
  request.outputs = read_outputs(known.outputs, known.output_count);
  if (known.noise_seeds) request.noise_seeds.assign(known.noise_seeds, known.noise_seeds + engine.batch_count());
  request.progress = known.progress;
  request.progress_user = known.progress_user;
  request.wait = ks::point_of(engine.device(), known.wait);
  return request;
}

void copy_rotation(const simsense::Rotation& rotation, double matrix[16]) {
  std::fill(matrix, matrix + 16, 0.0);
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) matrix[4 * i + j] = rotation[3 * i + j];
  matrix[15] = 1;
}

}  // namespace

extern "C" {

ks_status simsense_engine_create(simsense_device device, const simsense_rig_desc* rig, const simsense_parameters* parameters,
                                 simsense_engine* out) {
  return ks::call([&] {
    ks::clear_out(out);
    const auto known_rig = ks::read_struct(rig, SIMSENSE_TYPE_RIG_DESC, "rig");
    *out =
        new simsense_engine_t(std::make_shared<simsense::Engine>(ks::object_of(device, "device"), known_rig, read_parameters(parameters)));
  });
}

ks_status simsense_engine_set_parameters(simsense_engine engine, const simsense_parameters* parameters) {
  return ks::call([&] { ks::Exclusive(engine, "engine")->set_parameters(read_parameters(parameters)); });
}

ks_status simsense_engine_get_parameters(simsense_engine engine, simsense_parameters* out) {
  return ks::call([&] { ks::write_struct(out, ks::Exclusive(engine, "engine")->parameters(), SIMSENSE_TYPE_PARAMETERS, "out"); });
}

ks_status simsense_signal_preset(const char* name, simsense_signal* out) {
  return ks::call([&] { ks::write_struct(out, simsense::signal_preset(name), SIMSENSE_TYPE_SIGNAL, "out"); });
}

ks_status simsense_signal_analogue(const simsense_signal* signal, const float* light, uint32_t width, uint32_t height, uint64_t seed,
                                   uint64_t frame_index, uint32_t side, float* dn) {
  return ks::call([&] {
    auto known = ks::read_struct(signal, SIMSENSE_TYPE_SIGNAL, "signal");
    simsense::check_signal(known, "the");
    known.extra_bits = 0;  // DN are of 8 bits
    if (light == nullptr || dn == nullptr) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL", light == nullptr ? "light" : "dn");
    if (side > 1) ks::fail(KS_ERROR_INVALID_ARGUMENT, "side is %u, must be 0 (left) or 1 (right)", side);
    constexpr uint64_t most_pixels = 1u << 26;
    if (width == 0 || height == 0 || uint64_t{width} * height > most_pixels)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "image of %u x %u pixels, must have 1 to %llu", width, height,
               static_cast<unsigned long long>(most_pixels));
    const simsense::ConstPlane all{reinterpret_cast<const std::byte*>(light), ptrdiff_t{sizeof(float)} * width, sizeof(float),
                                   KS_FORMAT_F32};
    ks::ThreadPool caller(1);
    simsense::cpu::measure(simsense::Imager(known), {seed, frame_index, known.scene_index, known.first_view, side}, {all, {}}, width,
                           height, dn, caller);
  });
}

ks_status simsense_engine_set_signal(simsense_engine engine, const simsense_signal* left, const simsense_signal* right) {
  return ks::call([&] {
    const ks::Exclusive object(engine, "engine");
    object->set_signal(ks::read_struct(left, SIMSENSE_TYPE_SIGNAL, "left signal"),
                       ks::read_struct(right, SIMSENSE_TYPE_SIGNAL, "right signal"));
  });
}

ks_status simsense_engine_get_signal(simsense_engine engine, simsense_signal* left, simsense_signal* right) {
  return ks::call([&] {
    const ks::Exclusive object(engine, "engine");
    if (left) ks::write_struct(left, object->signal(0), SIMSENSE_TYPE_SIGNAL, "left signal");
    if (right) ks::write_struct(right, object->signal(1), SIMSENSE_TYPE_SIGNAL, "right signal");
  });
}

void simsense_engine_retain(simsense_engine engine) { ks::retain(engine, "engine"); }

void simsense_engine_release(simsense_engine engine) { ks::release(engine, "engine"); }

ks_status simsense_engine_get_rectified(simsense_engine engine, double* k, double* baseline_m, double* left_to_rectified) {
  return ks::call([&] {
    const ks::Exclusive object(engine, "engine");
    const simsense::StereoGeometry& geometry = object->geometry();
    const simsense::Pinhole& c = geometry.camera;
    const double matrix[9] = {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1};
    if (k) std::copy(matrix, matrix + 9, k);
    if (baseline_m) *baseline_m = geometry.baseline_m;
    if (left_to_rectified) copy_rotation(geometry.left_to_rectified, left_to_rectified);
  });
}

ks_status simsense_engine_compute(simsense_engine engine, const simsense_compute_desc* desc) {
  return ks::call([&] {
    const ks::Exclusive object(engine, "engine");
    object->compute(read_request(*object, desc));
  });
}

ks_status simsense_engine_submit(simsense_engine engine, const simsense_compute_desc* desc, ks_sync* out) {
  return ks::call([&] {
    (void)ks::check_header(out, KS_TYPE_SYNC, "out");  // before work begins that nobody could wait for
    const ks::Exclusive object(engine, "engine");
    ks::write_struct(out, object->submit(read_request(*object, desc)), KS_TYPE_SYNC, "out");
  });
}

ks_status simsense_engine_wait(simsense_engine engine, const ks_sync* sync) { return simsense_engine_wait_for(engine, sync, UINT64_MAX); }

ks_status simsense_engine_wait_for(simsense_engine engine, const ks_sync* sync, uint64_t timeout_ns) {
  return ks::call([&] {
    if (!ks::Exclusive(engine, "engine")->wait(ks::read_struct(sync, KS_TYPE_SYNC, "sync"), timeout_ns))
      ks::fail(KS_ERROR_TIMEOUT, "the submission has not ended after %.3g s; it goes on", double(timeout_ns) * 1e-9);
  });
}

ks_status simsense_engine_cancel(simsense_engine engine) {
  return ks::call([&] { ks::object_of(engine, "engine")->cancel(); });
}

ks_status simsense_engine_export_timeline(simsense_engine engine, ks_sync* out) {
  return ks::call([&] {
    (void)ks::check_header(out, KS_TYPE_SYNC, "out");  // before an fd is made that nobody would close
    ks::write_struct(out, ks::Exclusive(engine, "engine")->export_timeline(), KS_TYPE_SYNC, "out");
  });
}

ks_status simsense_engine_get_stage_times(simsense_engine engine, ks_stage_time* times, uint32_t* count) {
  return ks::call([&] {
    if (count == nullptr) ks::fail(KS_ERROR_INVALID_ARGUMENT, "count is NULL");
    const ks::Exclusive object(engine, "engine");
    const std::vector<ks_stage_time>& known = object->stage_times();
    if (times) std::copy_n(known.begin(), std::min<size_t>(*count, known.size()), times);
    *count = static_cast<uint32_t>(known.size());
  });
}

}  // extern "C"
