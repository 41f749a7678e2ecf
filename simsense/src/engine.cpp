#include "engine.h"

#include <algorithm>
#include <array>
#include <limits>

#include "device/device.h"
#include "device/error.h"
#include "device/thread_pool.h"
#include "rectify/remap.h"
#include "vulkan/host_batch.h"

namespace simsense {
namespace {

constexpr uint32_t output_count = SIMSENSE_OUTPUT_POINTS + 1;
constexpr const char* output_names[output_count] = {"",         "disparity",      "depth",           "depth_rgb", "ir_left",
                                                    "ir_right", "rectified_left", "rectified_right", "points"};

const char* format_name(uint32_t format) { return format == KS_FORMAT_U8 ? "u8" : format == KS_FORMAT_U16 ? "u16" : "f32"; }

const simsense_rig_desc& checked(const simsense_rig_desc& rig) {
  check_rig(rig);
  return rig;
}

void check_progress(const ComputeRequest& request, uint32_t pair, uint32_t pairs) {
  if (request.progress && request.progress(request.progress_user, static_cast<float>(pair) / static_cast<float>(pairs)))
    ks::fail(KS_ERROR_CANCELLED, "cancelled by the progress callback before pair %u of %u", pair, pairs);
}

PointMaker make_points(const simsense_rig_desc& rig, const StereoGeometry& geometry) {
  return rig.rgb.width ? PointMaker(rig.rgb) : PointMaker(geometry.camera, rig.left.width, rig.left.height);
}

}  // namespace

struct Engine::Frame {
  std::optional<ImageAccess> inputs[2];
  std::array<std::optional<ImageAccess>, output_count> outputs;

  [[nodiscard]] bool wants(uint32_t output) const { return outputs[output].has_value(); }
  [[nodiscard]] bool wants_disparity() const {
    return wants(SIMSENSE_OUTPUT_DISPARITY) || wants(SIMSENSE_OUTPUT_DEPTH) || wants(SIMSENSE_OUTPUT_DEPTH_RGB) ||
           wants(SIMSENSE_OUTPUT_POINTS);
  }

  /// Where a stage writes an output of one component: the caller's memory if it is packed, else scratch.
  template <class T>
  T* target(uint32_t output, uint32_t batch_index, std::vector<T>& scratch, size_t pixels) const {
    if (wants(output) && outputs[output]->is_packed()) return reinterpret_cast<T*>(outputs[output]->output(batch_index).data);
    scratch.resize(pixels);
    return scratch.data();
  }

  /// Scatters rows that a stage could not write in place.
  template <class T>
  void store(uint32_t output, uint32_t batch_index, const T* from, ptrdiff_t row_stride, uint32_t width, uint32_t height) const {
    if (!wants(output)) return;
    const Plane to = outputs[output]->output(batch_index);
    if (static_cast<const void*>(from) == to.data) return;
    for (uint32_t y = 0; y < height; ++y)
      for (uint32_t x = 0; x < width; ++x) to.set(x, y, from[static_cast<ptrdiff_t>(y) * row_stride + x]);
  }
};

Engine::Engine(std::shared_ptr<ks::Device> device, const simsense_rig_desc& rig, const simsense_parameters& parameters)
    : device_(std::move(device)),
      workers_(device_->workers()),
      rig_(checked(rig)),
      parameters_(parameters),
      rectification_(make_rectification(rig)),
      width_(rig.left.width),
      height_(rig.left.height),
      has_rgb_(rig.rgb.width != 0),
      points_(make_points(rig, rectification_.geometry)) {
  check_parameters(parameters);
  on_device_ = use_vulkan(parameters);
  if (has_rgb_) registration_.emplace(rig, rectification_.geometry);
}

Engine::~Engine() = default;

void Engine::set_parameters(const simsense_parameters& parameters) {
  check_parameters(parameters);
  on_device_ = use_vulkan(parameters);
  if (!(match_parameters(parameters) == match_parameters(parameters_))) {
    matcher_.reset();
    device_batch_.reset();
  }
  parameters_ = parameters;
}

bool Engine::use_vulkan(const simsense_parameters& parameters) const {
  if (rig_.back_end == SIMSENSE_BACK_END_CPU || (rig_.back_end == SIMSENSE_BACK_END_AUTO && device_->is_cpu())) return false;
  const std::string why_not = why_not_vulkan(*device_, width_, height_, rig_.batch_count, match_parameters(parameters));
  if (why_not.empty()) return true;
  if (rig_.back_end == SIMSENSE_BACK_END_VULKAN)
    ks::fail(KS_ERROR_UNSUPPORTED, "back_end is vulkan, but the Vulkan matcher cannot serve on %s: %s", device_->info().name,
             why_not.c_str());
  return false;
}

void Engine::set_signal(const simsense_signal& left, const simsense_signal& right) {
  check_signal(left, "left");
  check_signal(right, "right");
  Imager left_imager(left, &imagers_[0]);
  Imager right_imager(right, &imagers_[1]);
  imagers_[0] = std::move(left_imager);
  imagers_[1] = std::move(right_imager);
}

uint32_t Engine::output_format(uint32_t output) const {
  if (output == SIMSENSE_OUTPUT_IR_LEFT || output == SIMSENSE_OUTPUT_IR_RIGHT)
    return imagers_[output - SIMSENSE_OUTPUT_IR_LEFT].is_wide() ? KS_FORMAT_U16 : KS_FORMAT_U8;
  return output == SIMSENSE_OUTPUT_RECTIFIED_LEFT || output == SIMSENSE_OUTPUT_RECTIFIED_RIGHT ? KS_FORMAT_U8 : KS_FORMAT_F32;
}

ImageShape Engine::output_shape(uint32_t output) const {
  const bool in_rgb = output == SIMSENSE_OUTPUT_DEPTH_RGB || (output == SIMSENSE_OUTPUT_POINTS && has_rgb_);
  const simsense_camera& camera = in_rgb ? rig_.rgb : rig_.left;
  return {rig_.batch_count, camera.height, camera.width, output == SIMSENSE_OUTPUT_POINTS ? 3u : 0u};
}

void Engine::open_outputs(const ComputeRequest& request, Frame& frame) const {
  for (const ComputeRequest::Output& wanted : request.outputs) {
    const uint32_t output = wanted.output;
    if (output == 0 || output >= output_count)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u is unknown: SIMSENSE_OUTPUT_* are 1..%u", output, output_count - 1);
    if (frame.wants(output)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) is listed twice", output, output_names[output]);
    if (output == SIMSENSE_OUTPUT_DEPTH_RGB && !has_rgb_)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (depth_rgb) needs a rig with an rgb camera: rgb.width is 0", output);
    if (wanted.image.image.format != output_format(output))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) has format %u: must be %u (%s)", output, output_names[output],
               wanted.image.image.format, output_format(output), format_name(output_format(output)));
    frame.outputs[output].emplace(*device_, wanted.image, output_shape(output), output_names[output]);
  }
}

void Engine::compute(const ComputeRequest& request) {
  clock_.reset();
  if (request.outputs.empty()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output_count is 0: nothing to compute");
  Frame frame;
  const ImageShape input_shape{rig_.batch_count, height_, width_, 0};
  frame.inputs[0].emplace(*device_, request.left, input_shape, "left image");
  frame.inputs[1].emplace(*device_, request.right, input_shape, "right image");
  for (const auto& input : frame.inputs)
    if (input->format() != KS_FORMAT_U8 && input->format() != KS_FORMAT_U16 && input->format() != KS_FORMAT_F32)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s image has format %u: must be u8 (1), u16 (2) or f32 (6)",
               &input == frame.inputs ? "left" : "right", input->format());
  open_outputs(request, frame);
  on_device_ ? compute_on_device(frame, request) : compute_on_host(frame, request);
  for (auto& output : frame.outputs)
    if (output) output->commit();
  if (request.progress) request.progress(request.progress_user, 1);
}

void Engine::compute_on_host(Frame& frame, const ComputeRequest& request) {
  for (uint32_t n = 0; n < rig_.batch_count; ++n) {
    check_progress(request, n, rig_.batch_count);
    const ConstImage left = prepare_eye(frame, n, 0);
    const ConstImage right = prepare_eye(frame, n, 1);
    if (!frame.wants_disparity()) continue;
    float* disparity = frame.target(SIMSENSE_OUTPUT_DISPARITY, n, disparity_, size_t{width_} * height_);
    match(left, right, disparity);
    finish_pair(frame, n, disparity);
  }
}

void Engine::compute_on_device(Frame& frame, const ComputeRequest& request) {
  const uint32_t count = rig_.batch_count;
  if (!device_batch_ && frame.wants_disparity())
    device_batch_ = std::make_unique<VulkanHostBatch>(device_, width_, height_, count, match_parameters(parameters_));
  for (uint32_t n = 0; n < count; ++n) {
    check_progress(request, n, count);
    const ConstImage left = prepare_eye(frame, n, 0);
    const ConstImage right = prepare_eye(frame, n, 1);
    if (frame.wants_disparity()) device_batch_->put(n, left, right);
  }
  if (!frame.wants_disparity()) return;
  device_batch_->match();
  for (const ks_stage_time& stage : device_batch_->stage_times()) clock_.add(stage.name, stage.milliseconds);
  for (uint32_t n = 0; n < count; ++n) finish_pair(frame, n, device_batch_->disparity(n));
}

NoiseKey Engine::noise_key(uint32_t n, uint32_t eye) const {
  const simsense_signal& s = signal(eye);
  return {parameters_.noise_seed, parameters_.frame_index, s.scene_index, s.first_view + n, eye};
}

/// The image as the matcher takes it, 8 bit: the caller's own pixels where nothing changes them.
ConstImage Engine::measure_eye(Frame& frame, uint32_t n, uint32_t eye) {
  const Imager& imager = imagers_[eye];
  const auto pitch = static_cast<ptrdiff_t>(width_);
  if (imager.is_wide()) return {measure_wide(frame, n, eye), pitch};
  const uint32_t output = SIMSENSE_OUTPUT_IR_LEFT + eye;
  const ConstPlane input = frame.inputs[eye]->input(n);
  ConstImage image{reinterpret_cast<const uint8_t*>(input.data), input.row_stride};
  if (input.format != KS_FORMAT_U8 || input.pixel_stride != 1 || !imager.is_neutral()) {
    uint8_t* counts = frame.target(output, n, counts_[eye], size_t{width_} * height_);
    imager.measure(noise_key(n, eye), input, width_, height_, counts, workers_);
    image = {counts, pitch};
  }
  frame.store(output, n, image.data, image.row_stride, width_, height_);
  return image;
}

/// More than 8 bits: the output has them all, the matcher's image the leading 8.
const uint8_t* Engine::measure_wide(Frame& frame, uint32_t n, uint32_t eye) {
  const uint32_t output = SIMSENSE_OUTPUT_IR_LEFT + eye;
  const size_t pixels = size_t{width_} * height_;
  uint16_t* counts = frame.target(output, n, wide_counts_, pixels);
  imagers_[eye].measure(noise_key(n, eye), frame.inputs[eye]->input(n), width_, height_, counts, workers_);
  frame.store(output, n, counts, static_cast<ptrdiff_t>(width_), width_, height_);
  counts_[eye].resize(pixels);
  const uint32_t shift = signal(eye).bit_depth - 8;
  std::transform(counts, counts + pixels, counts_[eye].begin(), [=](uint16_t count) { return static_cast<uint8_t>(count >> shift); });
  return counts_[eye].data();
}

ConstImage Engine::prepare_eye(Frame& frame, uint32_t n, uint32_t eye) {
  ConstImage image;
  clock_.measure("signal", [&] { image = measure_eye(frame, n, eye); });
  const uint32_t output = SIMSENSE_OUTPUT_RECTIFIED_LEFT + eye;
  clock_.measure("rectify", [&] {
    if (!rectification_.is_identity()) {
      uint8_t* rectified = frame.target(output, n, rectified_[eye], size_t{width_} * height_);
      const auto resample = rig_.faults & SIMSENSE_FAULT_REMAP_NEAREST ? remap_nearest : remap;
      resample(eye == 0 ? rectification_.left : rectification_.right, image, rectified, workers_);
      image = {rectified, static_cast<ptrdiff_t>(width_)};
    }
    frame.store(output, n, image.data, image.row_stride, width_, height_);
  });
  return image;
}

void Engine::match(ConstImage left, ConstImage right, float* disparity) {
  if (!matcher_) matcher_ = make_cpu_matcher(width_, height_, match_parameters(parameters_), workers_);
  matcher_->match(left, right, disparity);
  for (const ks_stage_time& stage : matcher_->stage_times()) clock_.add(stage.name, stage.milliseconds);
}

/// What follows from a pair's disparities.
void Engine::finish_pair(Frame& frame, uint32_t n, float* disparity) {
  if (!rectification_.is_identity() && !(rig_.faults & SIMSENSE_FAULT_PADDING_MATCHED))
    clock_.measure("rectify", [&] { invalidate_outside(rectification_.left, disparity, workers_); });
  const bool points = frame.wants(SIMSENSE_OUTPUT_POINTS);
  frame.store(SIMSENSE_OUTPUT_DISPARITY, n, disparity, width_, width_, height_);
  if (frame.wants(SIMSENSE_OUTPUT_DEPTH) || (points && !has_rgb_)) make_depth(frame, n, disparity);
  if (frame.wants(SIMSENSE_OUTPUT_DEPTH_RGB) || (points && has_rgb_)) make_registered(frame, n, disparity);
}

void Engine::make_depth(Frame& frame, uint32_t n, const float* disparity) {
  float* depth = frame.target(SIMSENSE_OUTPUT_DEPTH, n, depth_, size_t{width_} * height_);
  clock_.measure("depth", [&] {
    depth_from_disparity(geometry(), depth_range(parameters_), disparity, width_, height_, depth, workers_);
    frame.store(SIMSENSE_OUTPUT_DEPTH, n, depth, width_, width_, height_);
  });
  if (!frame.wants(SIMSENSE_OUTPUT_POINTS) || has_rgb_) return;
  const ImageAccess& points = *frame.outputs[SIMSENSE_OUTPUT_POINTS];
  clock_.measure("points", [&] { points_.apply(depth, points.output(n), points.component_stride(), workers_); });
}

void Engine::make_registered(Frame& frame, uint32_t n, const float* disparity) {
  // The range holds in the RGB camera's own frame, so that what lies outside it in the left frame still occludes.
  constexpr DepthRange everything{0, std::numeric_limits<float>::infinity()};
  depth_.resize(size_t{width_} * height_);
  float* depth_rgb = frame.target(SIMSENSE_OUTPUT_DEPTH_RGB, n, depth_rgb_, size_t{rig_.rgb.width} * rig_.rgb.height);
  clock_.measure("registration", [&] {
    depth_from_disparity(geometry(), everything, disparity, width_, height_, depth_.data(), workers_);
    registration_->apply(depth_.data(), depth_range(parameters_), parameters_.depth_dilation != 0, depth_rgb, workers_);
    frame.store(SIMSENSE_OUTPUT_DEPTH_RGB, n, depth_rgb, rig_.rgb.width, rig_.rgb.width, rig_.rgb.height);
  });
  if (!frame.wants(SIMSENSE_OUTPUT_POINTS)) return;
  const ImageAccess& points = *frame.outputs[SIMSENSE_OUTPUT_POINTS];
  clock_.measure("points", [&] { points_.apply(depth_rgb, points.output(n), points.component_stride(), workers_); });
}

}  // namespace simsense
