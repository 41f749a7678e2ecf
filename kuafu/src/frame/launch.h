// SPDX-License-Identifier: Apache-2.0
// A launch is one render call, checked, in the renderer's own terms. Thread rule: plain data.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <vector>

#include "device/buffer.h"
#include "device/timeline.h"
#include "frame/band.h"
#include "scene/camera.h"
#include "scene/scene.h"
#include "shared/aov_record.h"
#include "shared/wave.h"

namespace kuafu {

struct View {
  glm::dmat3 k{1.0};
  glm::dmat4 camera_to_world{1.0};
  double near_m = 0.0, far_m = 0.0;
  uint32_t environment = 0;
  Optics optics;
  Lens lens;
  Shutter shutter;
  Twist velocity;
  glm::dmat4 previous_camera_to_world{1.0};  // one frame before
  /// Whether the view's rays differ from a resting pinhole's.
  [[nodiscard]] bool special() const;
};

enum class LightSampling { mis, lights, bsdf };
enum class DenoiseKind { none, atrous, oidn };

/// The place of an output in the caller's buffer. `first` and the strides count elements, from the word at offset_bytes on. An output
/// without a buffer is not wanted.
struct OutputImage {
  std::shared_ptr<ks::Buffer> buffer;
  uint64_t offset_bytes = 0;
  int first = 0, view_stride = 0, row_stride = 0;
  uint32_t format = format_f32;
  float scale = 1.0f;
  /// Whether the stages can write the image directly, without the step `write`.
  [[nodiscard]] bool is_plain() const { return format_bits(format) == 32 && scale == 1.0f; }
};

inline constexpr uint32_t output_projector_direct = output_radiance + 1 + group_projector_direct,
                          output_projector_indirect = output_radiance + 1 + group_projector_indirect;
/// The images whose sum is output_projector.
inline constexpr uint32_t projector_parts = 1u << output_projector_direct | 1u << output_projector_indirect;

/// Whether the frame computes the output from other images on delivery.
[[nodiscard]] constexpr bool is_made(uint32_t kind) { return kind == output_projector || kind == output_srgb; }

[[nodiscard]] constexpr bool is_integer(uint32_t kind) {
  return (kind >= output_instance_id && kind <= output_semantic_id) || kind == output_sample_count;
}

struct Launch {
  std::vector<View> views;
  uint32_t width = 0, height = 0;
  Band band;
  uint32_t samples = 1, first_sample = 0, max_bounces = 0;
  bool accumulate = false;              // the samples are added to those of the calls before
  bool straight_through_glass = false;  // shadow rays are not bent there
  double max_seconds = 0.0;             // 0: no limit
  double relative_error = 0.0;          // 0: no limit
  uint64_t seed = 0;
  float pixel_blur_px = 0.0f;  // side of the square that blurs a pixel's own
  LightSampling light_sampling = LightSampling::mis;
  DenoiseKind denoise = DenoiseKind::none;
  float temporal_weight = 0.0f;  // share of the last launches' light, where the denoiser accumulates
  uint32_t glass_surfaces = 0;   // how many of them a shadow ray may pass
  std::array<OutputImage, output_kind_count> outputs;
  uint32_t projector = none;  // the light that the projector's AOVs are about; none: the first projector of each environment
  uint32_t held = 0;          // a bit for each output that a step after the paths reads from the frame, asked for or not
  /// The renderer calls it between waves with the finished share, 0..1; true cancels. It may be empty.
  std::function<bool(float)> cancelled;
  ks::TimelinePoint wait;  // what comes before a buffer is read or written

  [[nodiscard]] uint32_t pixel_count() const { return uint32_t(views.size()) * width * height; }
  [[nodiscard]] uint32_t environment_count() const {
    uint32_t count = 1;
    for (const View& v : views) count = std::max(count, v.environment + 1);
    return count;
  }
  [[nodiscard]] bool wants(uint32_t first_kind, uint32_t end_kind) const {
    for (uint32_t k = first_kind; k < end_kind; ++k)
      if (outputs[k].buffer || (held >> k & 1) != 0) return true;
    return false;
  }
  /// Whether the caller gets this image, or one that is computed from it.
  [[nodiscard]] bool shows(uint32_t kind) const {
    return outputs[kind].buffer || (outputs[output_projector].buffer && (projector_parts >> kind & 1) != 0) ||
           (outputs[output_srgb].buffer && kind == output_radiance);
  }
  [[nodiscard]] uint32_t channels(uint32_t kind) const {
    if (kind == output_sample_count) return 1;
    if (kind == output_srgb) return 4;
    if (kind >= output_radiance || kind == output_albedo) return band.channels();
    if (kind == output_normal || kind == output_position) return 3;
    return kind == output_projector_uv || kind == output_motion ? 2 : 1;
  }
  [[nodiscard]] bool wants_aovs() const { return wants(output_depth, output_radiance); }
  [[nodiscard]] bool has_budget() const { return max_seconds > 0.0 || relative_error > 0.0; }
  [[nodiscard]] bool wants_variance() const { return relative_error > 0.0 || wants(output_variance, output_variance + 1); }
  [[nodiscard]] bool wants_projector() const { return wants(output_projector_uv, output_projector_geometry + 1); }
  [[nodiscard]] bool wants_visibility() const { return wants(output_projector_visibility, output_projector_visibility + 1); }
  [[nodiscard]] bool wants_motion() const { return wants(output_motion, output_motion + 1); }
  [[nodiscard]] bool wants_radiance() const { return wants(output_radiance, output_kind_count); }
};

/// The time in which any camera's shutter is open.
TimeSpan open_span(const Launch& launch);
/// A view's camera for stage `generate`; needed if view.special().
CameraRecord camera_record(const View& view);
/// The projection of points into the view, now and one frame before.
MotionView motion_view(const View& view);

/// A view's data for stage `generate`. The key of its samples depends on seed, camera and environment, not on its place in the batch. A
/// view therefore has the same bits alone or with others, and left and right cameras draw different samples.
ViewRecord view_record(const Launch& launch, const View& view);

}  // namespace kuafu
