#include "engine.h"

#include <algorithm>
#include <string>

#include "device/device.h"
#include "device/error.h"
#include "vulkan/pipeline.h"

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

/// done: the share of the pair that is.
void check_progress(const ComputeRequest& request, uint32_t pair, uint32_t pairs, float done) {
  if (request.progress && request.progress(request.progress_user, (static_cast<float>(pair) + done) / static_cast<float>(pairs)))
    ks::fail(KS_ERROR_CANCELLED, "cancelled by the progress callback in pair %u of %u", pair + 1, pairs);
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
  }
  parameters_ = parameters;
}

Region Engine::region(const simsense_parameters& p) const {
  if (p.roi_width == 0) return {0, 0, width_, height_};
  return {p.roi_x, p.roi_y, p.roi_x + p.roi_width, p.roi_y + p.roi_height};
}

bool Engine::use_vulkan(const simsense_parameters& parameters) const {
  if (rig_.back_end == SIMSENSE_BACK_END_CPU || (rig_.back_end == SIMSENSE_BACK_END_AUTO && device_->is_cpu())) return false;
  std::string why_not = why_no_pipeline(*device_, rig_);
  if (why_not.empty()) why_not = why_not_vulkan(*device_, width_, height_, rig_.batch_count, match_parameters(parameters));
  return why_not.empty() || refuse_vulkan(why_not);
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
  const bool was_wide = is_wide();
  if (pipeline_ && (left_imager.is_wide() || right_imager.is_wide()) != was_wide) pipeline_->wait_idle();  // its arrays may grow
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

void Engine::check_output(const ComputeRequest::Output& wanted, bool listed_before, bool has_rgb_image) const {
  const uint32_t output = wanted.output;
  if (output == 0 || output >= output_count)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u is unknown: they are 1..%u", output, output_count - 1);
  if (listed_before) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) is listed twice", output, output_names[output]);
  const bool colored = output == SIMSENSE_OUTPUT_POINTS_COLORED;
  if ((output == SIMSENSE_OUTPUT_DEPTH_RGB || colored) && !has_rgb_)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) needs a rig with an rgb camera, and this one has none", output,
             output_names[output]);
  if (colored && !has_rgb_image) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (points_colored) needs the rgb image", output);
  const uint32_t format = wanted.image.image.format, formats = output_formats(output);
  if (format > KS_FORMAT_F32 || !(formats & bit(format)))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) has format %u: must be %s", output, output_names[output], format,
             format_names(formats).c_str());
  constexpr int32_t whole_pixels = INT16_MAX / 16;  // what sixteenths of a pixel leave of 16 bits
  const int32_t farthest = parameters_.min_disparity + static_cast<int32_t>(parameters_.max_disparity) - 1;
  if (output == SIMSENSE_OUTPUT_DISPARITY && format == KS_FORMAT_I16 && farthest > whole_pixels)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "disparities reach %d pixels: in int16 sixteenths at most %d, take float32", farthest,
             whole_pixels);
}

template <class FrameType, class Open>
void Engine::open_frame(const ComputeRequest& request, FrameType& frame, const Open& open) const {
  if (request.outputs.empty()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "no output is asked for (output_count is 0): nothing to compute");
  const auto open_light = [&](const ImageArgument& light, const char* name) {
    const uint32_t format = light.image.format;
    if (format != KS_FORMAT_U8 && format != KS_FORMAT_U16 && format != KS_FORMAT_F32)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has format %u: must be u8 (1), u16 (2) or f32 (6)", name, format);
    return open(light, {rig_.batch_count, height_, width_, 0}, name);
  };
  frame.inputs[0].emplace(open_light(request.left, "left image"));
  frame.inputs[1].emplace(open_light(request.right, "right image"));
  if (request.lasers[0].has_value() != request.lasers[1].has_value())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "a laser image is given for the %s eye alone: give both or none",
             request.lasers[0] ? "left" : "right");
  if (request.lasers[0]) {
    frame.lasers[0].emplace(open_light(*request.lasers[0], "left laser image"));
    frame.lasers[1].emplace(open_light(*request.lasers[1], "right laser image"));
  }
  if (request.rgb) {
    if (!has_rgb_) ks::fail(KS_ERROR_INVALID_ARGUMENT, "an rgb image is given, but the rig has no rgb camera");
    if (request.rgb->image.format != KS_FORMAT_U8)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "rgb image has format %u: must be u8 (1)", request.rgb->image.format);
    frame.rgb.emplace(open(*request.rgb, {rig_.batch_count, rig_.rgb.height, rig_.rgb.width, 3}, "rgb image"));
  }
  for (const ComputeRequest::Output& wanted : request.outputs) {
    check_output(wanted, wanted.output < output_count && frame.wants(wanted.output), frame.rgb.has_value());
    frame.outputs[wanted.output].emplace(open(wanted.image, output_shape(wanted.output), output_names[wanted.output]));
  }
}

void Engine::compute(const ComputeRequest& request) {
  clock_.reset();
  if (on_device_) {
    wait_for_device(submit_to_device(request));
  } else {
    if (pipeline_) pipeline_->wait_idle();  // what was submitted before the parameters left the device comes first
    compute_on_host(request);
  }
  if (request.progress) request.progress(request.progress_user, 1);
}

ks_sync Engine::submit(const ComputeRequest& request) {
  const auto is_host = [](const ImageArgument& image) { return !image.buffer; };
  const auto is_host_if_any = [&](const std::optional<ImageArgument>& image) { return image && is_host(*image); };
  const bool on_host = is_host(request.left) || is_host(request.right) || is_host_if_any(request.lasers[0]) ||
                       is_host_if_any(request.lasers[1]) || is_host_if_any(request.rgb) ||
                       std::ranges::any_of(request.outputs, [&](const ComputeRequest::Output& o) { return is_host(o.image); });
  ks_sync sync = ks_sync_init();
  if (on_host || !on_device_) {
    compute(request);
    return sync;
  }
  clock_.reset();
  sync.value = submit_to_device(request);
  if (pipeline_->timeline()) sync.kind = KS_SYNC_TIMELINE;
  return sync;
}

void Engine::wait(const ks_sync& sync) {
  if (sync.kind == KS_SYNC_HOST) return;
  if (sync.kind != KS_SYNC_TIMELINE)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "sync: kind is %u, submit gives host (0) or timeline (2)", sync.kind);
  const uint64_t submitted = pipeline_ ? pipeline_->submitted() : 0;
  if (sync.value > submitted)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "sync: value is %llu, only %llu were submitted", static_cast<unsigned long long>(sync.value),
             static_cast<unsigned long long>(submitted));
  wait_for_device(sync.value);
}

ks_sync Engine::export_timeline() {
  if (!pipeline_ || !pipeline_->timeline())
    ks::fail(KS_ERROR_UNSUPPORTED, "there is no timeline: nothing was submitted to a Vulkan device that has one");
  ks_sync sync = ks_sync_init();
  sync.kind = KS_SYNC_TIMELINE_FD;
  sync.handle = static_cast<uint64_t>(pipeline_->timeline()->export_fd());
  sync.value = pipeline_->submitted();
  return sync;
}

void Engine::compute_on_host(const ComputeRequest& request) {
  Frame frame;
  open_frame(request, frame, [this](const ImageArgument& argument, const ImageShape& shape, const char* name) {
    return ImageAccess(*device_, argument, shape, name);
  });
  for (uint32_t n = 0; n < rig_.batch_count; ++n) {
    const auto tell = [&](float done) { check_progress(request, n, rig_.batch_count, done); };
    tell(0);
    const ConstImage left = prepare_eye(frame, n, 0);
    const ConstImage right = prepare_eye(frame, n, 1);
    if (!frame.wants_disparity()) continue;
    const MatchMaps maps = open_maps(frame, n);
    match(left, right, maps, tell);
    finish_pair(frame, n, maps);
    if (maps.reason) explain(frame, n, left, maps);
  }
  for (auto& output : frame.outputs)
    if (output) output->commit();
}

uint64_t Engine::submit_to_device(const ComputeRequest& request) {
  if (!pipeline_) {
    const PipelineParts parts{rig_, rectification_, registration_ ? &*registration_ : nullptr, points_};
    pipeline_ = std::make_unique<VulkanPipeline>(device_, parts);
  }
  DeviceFrame frame;
  pipeline_->staging().reset();
  open_frame(request, frame, [this](const ImageArgument& argument, const ImageShape& shape, const char* name) {
    return DeviceImage(pipeline_->staging(), argument, shape, name);
  });
  const Matching matching{match_parameters(parameters_), region(parameters_), reach(region(parameters_)), rig_.low_memory != 0};
  return pipeline_->submit(std::move(frame), {parameters_, imagers_, is_wide(), matching, request.progress, request.progress_user});
}

void Engine::wait_for_device(uint64_t submission) {
  pipeline_->wait(submission);
  clock_.reset();
  for (const auto& [name, milliseconds] : pipeline_->stage_times()) clock_.add(name.c_str(), milliseconds);
}

}  // namespace simsense
