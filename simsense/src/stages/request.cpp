// SPDX-License-Identifier: Apache-2.0
#include "stages/request.h"

#include <algorithm>
#include <string>

#include "device/error.h"

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

/// Bit k: KS_FORMAT_ k is possible.
uint32_t output_formats(uint32_t output, const StageSettings& settings) {
  switch (output) {
    case SIMSENSE_OUTPUT_IR_LEFT:
    case SIMSENSE_OUTPUT_IR_RIGHT:
    case SIMSENSE_OUTPUT_RECTIFIED_LEFT:
    case SIMSENSE_OUTPUT_RECTIFIED_RIGHT: {
      const bool is_rectified = output == SIMSENSE_OUTPUT_RECTIFIED_LEFT || output == SIMSENSE_OUTPUT_RECTIFIED_RIGHT;
      const bool wide = is_rectified ? settings.wide : settings.imagers[output - SIMSENSE_OUTPUT_IR_LEFT].is_wide();
      if (settings.extra_bits > 0) return bit(KS_FORMAT_U8) | bit(KS_FORMAT_U16);
      return bit(wide ? KS_FORMAT_U16 : KS_FORMAT_U8);
    }
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

void check_light(const ImageArgument& light, const char* name) {
  const uint32_t format = light.image.format;
  if (format != KS_FORMAT_U8 && format != KS_FORMAT_U16 && format != KS_FORMAT_F32)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has format %u: must be u8 (1), u16 (2) or f32 (6)", name, format);
}

void check_output(const ComputeRequest::Output& wanted, const PreparedRig& rig, const StageSettings& settings, bool has_rgb_image) {
  const uint32_t output = wanted.output;
  const bool colored = output == SIMSENSE_OUTPUT_POINTS_COLORED;
  if ((output == SIMSENSE_OUTPUT_DEPTH_RGB || colored) && !rig.rgb)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) needs a rig with an rgb camera, and this one has none", output,
             output_names[output]);
  if (colored && !has_rgb_image) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (points_colored) needs the rgb image", output);
  const uint32_t format = wanted.image.image.format, formats = output_formats(output, settings);
  if (format > KS_FORMAT_F32 || !(formats & bit(format)))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) has format %u: must be %s", output, output_names[output], format,
             format_names(formats).c_str());
  constexpr int32_t whole_pixels = INT16_MAX / 16;  // what sixteenths of a pixel leave of 16 bits
  const int32_t farthest = settings.match.min_disparity + static_cast<int32_t>(settings.match.max_disparity) - 1;
  if (output == SIMSENSE_OUTPUT_DISPARITY && format == KS_FORMAT_I16 && farthest > whole_pixels)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "disparities reach %d pixels: in int16 sixteenths at most %d, take float32", farthest,
             whole_pixels);
}

void check_rgb_image(const ImageArgument& rgb, const PreparedRig& rig) {
  if (!rig.rgb) ks::fail(KS_ERROR_INVALID_ARGUMENT, "an rgb image is given, but the rig has no rgb camera");
  if (rgb.image.format != KS_FORMAT_U8) ks::fail(KS_ERROR_INVALID_ARGUMENT, "rgb image has format %u: must be u8 (1)", rgb.image.format);
}

}  // namespace

const char* output_name(uint32_t output) { return output_names[output]; }

ImageShape output_shape(uint32_t output, const PreparedRig& rig) {
  const bool points = output == SIMSENSE_OUTPUT_POINTS || output == SIMSENSE_OUTPUT_POINTS_COLORED;
  const bool in_rgb = output == SIMSENSE_OUTPUT_DEPTH_RGB || (points && rig.rgb);
  const simsense_camera& camera = in_rgb ? rig.rig.rgb : rig.rig.left;
  const uint64_t channels = output == SIMSENSE_OUTPUT_POINTS ? 3 : output == SIMSENSE_OUTPUT_POINTS_COLORED ? 6 : 0;
  return {rig.rig.batch_count, camera.height, camera.width, channels};
}

void check_request(const ComputeRequest& request, const PreparedRig& rig, const StageSettings& settings) {
  if (request.outputs.empty()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "no output is asked for (output_count is 0): nothing to compute");
  check_light(request.left, "left image");
  check_light(request.right, "right image");
  if (request.lasers[0].has_value() != request.lasers[1].has_value())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "a laser image is given for the %s camera alone: give both or none",
             request.lasers[0] ? "left" : "right");
  if (request.lasers[0]) check_light(*request.lasers[0], "left laser image");
  if (request.lasers[1]) check_light(*request.lasers[1], "right laser image");
  if (request.rgb) check_rgb_image(*request.rgb, rig);
  bool listed[output_count] = {};
  for (const ComputeRequest::Output& wanted : request.outputs) {
    const uint32_t output = wanted.output;
    if (output == 0 || output >= output_count)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u is unknown: they are 1..%u", output, output_count - 1);
    if (listed[output]) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output %u (%s) is listed twice", output, output_names[output]);
    listed[output] = true;
    check_output(wanted, rig, settings, request.rgb.has_value());
  }
}

bool ComputeRequest::has_host_image() const {
  const auto is_host = [](const ImageArgument& image) { return !image.buffer; };
  const auto is_host_if_any = [&](const std::optional<ImageArgument>& image) { return image && is_host(*image); };
  return is_host(left) || is_host(right) || is_host_if_any(lasers[0]) || is_host_if_any(lasers[1]) || is_host_if_any(rgb) ||
         std::ranges::any_of(outputs, [&](const Output& o) { return is_host(o.image); });
}

void ComputeRequest::tell_progress(uint32_t pair, uint32_t pairs, float done_of_pair) const {
  if (progress && progress(progress_user, (static_cast<float>(pair) + done_of_pair) / static_cast<float>(pairs)))
    ks::fail(KS_ERROR_CANCELLED, "cancelled by the progress callback in pair %u of %u", pair + 1, pairs);
}

}  // namespace simsense
