#include "engine.h"

#include <string>

#include "device/device.h"
#include "device/error.h"
#include "vulkan/host_batch.h"

namespace simsense {
namespace {

constexpr const char* output_names[output_count] = {"",        "disparity",  "depth",          "depth_rgb",
                                                    "ir_left", "ir_right",   "rectified_left", "rectified_right",
                                                    "points",  "confidence", "reason",         "points_colored"};

constexpr uint32_t bit(uint32_t format) { return 1u << format; }

std::string format_names(uint32_t formats) {
  constexpr const char* names[] = {"", "u8", "u16", "i16", "u32", "f16", "f32"};
  std::string text;
  for (uint32_t format = 1; format <= KS_FORMAT_F32; ++format)
    if (formats & bit(format)) text += (text.empty() ? "" : " or ") + std::to_string(format) + " (" + names[format] + ")";
  return text;
}

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
  check_region(parameters, width_, height_);
  on_device_ = use_vulkan(parameters);
  if (has_rgb_) registration_.emplace(rig, rectification_.geometry);
}

Engine::~Engine() = default;

void Engine::set_parameters(const simsense_parameters& parameters) {
  check_parameters(parameters);
  check_region(parameters, width_, height_);
  on_device_ = use_vulkan(parameters);
  if (!(match_parameters(parameters) == match_parameters(parameters_)) || !(region(parameters) == region(parameters_))) {
    matcher_.reset();
    device_batch_.reset();
  }
  parameters_ = parameters;
}

Region Engine::region(const simsense_parameters& p) const {
  if (p.roi_width == 0) return {0, 0, width_, height_};
  return {p.roi_x, p.roi_y, p.roi_x + p.roi_width, p.roi_y + p.roi_height};
}

bool Engine::use_vulkan(const simsense_parameters& parameters) const {
  if (rig_.back_end == SIMSENSE_BACK_END_CPU || (rig_.back_end == SIMSENSE_BACK_END_AUTO && device_->is_cpu())) return false;
  std::string why_not = why_not_vulkan(*device_, width_, height_, rig_.batch_count, match_parameters(parameters));
  if (parameters.roi_width != 0) why_not = "it knows no region of interest";
  return why_not.empty() || refuse_vulkan(why_not);
}

/// Of this call: the imagers and the outputs may ask for more than the Vulkan matcher has.
bool Engine::use_vulkan(const Frame& frame) const {
  if (!on_device_) return false;
  if (is_wide()) return refuse_vulkan("it takes 8-bit images, and an imager has more");
  if (frame.wants(SIMSENSE_OUTPUT_CONFIDENCE) || frame.wants(SIMSENSE_OUTPUT_REASON))
    return refuse_vulkan("it gives neither confidence nor reasons");
  return true;
}

bool Engine::refuse_vulkan(const std::string& why_not) const {
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

uint32_t Engine::output_formats(uint32_t output) const {
  switch (output) {
    case SIMSENSE_OUTPUT_IR_LEFT:
    case SIMSENSE_OUTPUT_IR_RIGHT:
      return bit(imagers_[output - SIMSENSE_OUTPUT_IR_LEFT].is_wide() ? KS_FORMAT_U16 : KS_FORMAT_U8);
    case SIMSENSE_OUTPUT_RECTIFIED_LEFT:
    case SIMSENSE_OUTPUT_RECTIFIED_RIGHT:
      return bit(is_wide() ? KS_FORMAT_U16 : KS_FORMAT_U8);
    case SIMSENSE_OUTPUT_REASON:
      return bit(KS_FORMAT_U8);
    case SIMSENSE_OUTPUT_DISPARITY:
      return bit(KS_FORMAT_F32) | bit(KS_FORMAT_I16);
    case SIMSENSE_OUTPUT_DEPTH:
    case SIMSENSE_OUTPUT_DEPTH_RGB:
      return bit(KS_FORMAT_F32) | bit(KS_FORMAT_U16) | bit(KS_FORMAT_I16);
    default:
      return bit(KS_FORMAT_F32);
  }
}

ImageShape Engine::output_shape(uint32_t output) const {
  const bool points = output == SIMSENSE_OUTPUT_POINTS || output == SIMSENSE_OUTPUT_POINTS_COLORED;
  const bool in_rgb = output == SIMSENSE_OUTPUT_DEPTH_RGB || (points && has_rgb_);
  const simsense_camera& camera = in_rgb ? rig_.rgb : rig_.left;
  const uint64_t channels = output == SIMSENSE_OUTPUT_POINTS ? 3 : output == SIMSENSE_OUTPUT_POINTS_COLORED ? 6 : 0;
  return {rig_.batch_count, camera.height, camera.width, channels};
}

void Engine::open_outputs(const ComputeRequest& request, Frame& frame) const {
  for (const ComputeRequest::Output& wanted : request.outputs) {
    const uint32_t output = wanted.output;
    if (output == 0 || output >= output_count)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u is unknown: SIMSENSE_OUTPUT_* are 1..%u", output, output_count - 1);
    if (frame.wants(output)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) is listed twice", output, output_names[output]);
    const bool colored = output == SIMSENSE_OUTPUT_POINTS_COLORED;
    if ((output == SIMSENSE_OUTPUT_DEPTH_RGB || colored) && !has_rgb_)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) needs a rig with an rgb camera: rgb.width is 0", output, output_names[output]);
    if (colored && !frame.rgb) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (points_colored) needs the rgb image", output);
    const uint32_t format = wanted.image.image.format, formats = output_formats(output);
    if (format > KS_FORMAT_F32 || !(formats & bit(format)))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) has format %u: must be %s", output, output_names[output], format,
               format_names(formats).c_str());
    frame.outputs[output].emplace(*device_, wanted.image, output_shape(output), output_names[output]);
  }
}

void Engine::open_rgb(const ImageArgument& image, Frame& frame) const {
  if (!has_rgb_) ks::fail(KS_ERROR_INVALID_ARGUMENT, "an rgb image is given, but the rig has no rgb camera: rgb.width is 0");
  if (image.image.format != KS_FORMAT_U8)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "rgb image has format %u: must be u8 (1)", image.image.format);
  frame.rgb.emplace(*device_, image, ImageShape{rig_.batch_count, rig_.rgb.height, rig_.rgb.width, 3}, "rgb image");
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
  if (request.rgb) open_rgb(*request.rgb, frame);
  open_outputs(request, frame);
  use_vulkan(frame) ? compute_on_device(frame, request) : compute_on_host(frame, request);
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
    const MatchMaps maps = open_maps(frame, n);
    match(left, right, maps);
    finish_pair(frame, n, maps);
    if (maps.reason) explain(frame, n, left, maps);
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

}  // namespace simsense
