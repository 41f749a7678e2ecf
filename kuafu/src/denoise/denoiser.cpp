// SPDX-License-Identifier: Apache-2.0
#include "denoise/denoiser.h"

#include <algorithm>
#include <utility>

#include "scene/scene.h"
#include "spirv/denoise.h"
#include "spirv/guide.h"
#include "spirv/moments.h"
#include "spirv/remodulate.h"

namespace kuafu {
namespace {

constexpr uint32_t passes = 4;  // taps 1, 2, 4 and 8 pixels apart
constexpr uint32_t output_ambient = output_radiance + 1 + group_ambient;

}  // namespace

std::vector<uint32_t> denoised_kinds(const Launch& launch) {
  if (!launch.wants(output_light_group, output_light_group + light_group_count)) return {output_projector_indirect, output_ambient};
  std::vector<uint32_t> kinds = {output_projector_indirect};
  for (uint32_t group = 0; group < light_group_count; ++group) kinds.push_back(output_light_group + group);
  return kinds;
}

uint32_t held_for_denoiser(const Launch& launch) {
  if (launch.denoise == DenoiseKind::none || !launch.wants_radiance()) return 0;
  uint32_t held = 1u << output_radiance | 1u << output_projector_direct | 1u << output_ambient;
  for (const uint32_t kind : denoised_kinds(launch)) held |= 1u << kind;
  return held;
}

Denoiser::Denoiser(Memory memory, uint32_t queue_layout, std::string oidn_library)
    : memory_(std::move(memory)),
      guide_(memory_, guide_spirv, host::guide, queue_layout),
      moments_(memory_, moments_spirv, host::moments),
      denoise_(memory_, denoise_spirv, host::denoise),
      remodulate_(memory_, remodulate_spirv, host::remodulate, queue_layout),
      history_(memory_),
      oidn_library_(std::move(oidn_library)) {}

void Denoiser::fit(const Launch& launch, const Scene& scene, const Frame& frame) {
  const std::vector<uint32_t> kinds = denoised_kinds(launch);
  const uint64_t pixels = launch.pixel_count();
  channels_ = launch.band.channels();
  infrared_ = launch.band.infrared;
  DenoiseImages images{};
  for (size_t i = 0; i < kinds.size(); ++i) images.denoised[i] = frame.address(kinds[i]);
  images.direct = frame.address(output_projector_direct);
  images.ambient = frame.address(output_ambient);
  images.radiance = frame.address(output_radiance);
  images.denoised_count = uint32_t(kinds.size());
  images.channels = channels_;
  planes_ = uint32_t(kinds.size()) * channels_;
  blurs_ = std::ranges::any_of(launch.views, [&](const View& view) {
    const bool motion = view.velocity.moves() || scene.instances_move();
    return view.lens.lens_radius_m > 0.0 || (motion && view.shutter.exposure_s > 0.0);
  });
  accumulates_ = launch.denoise == DenoiseKind::atrous && launch.temporal_weight > 0.0f;
  if (accumulates_)
    history_.begin(launch, scene, kinds.size() * channels_, guides_, images);
  else
    history_.forget();
  images_.resize(memory_, 1)[0] = images;
  grow(memory_, guides_, guide_words(uint32_t(pixels)));
  grow(memory_, sums_, pixels * moment_words);
  for (auto& light : light_) grow(memory_, light, pixels * kinds.size() * channels_);
  for (auto& statistics : pixels_) grow(memory_, statistics, pixels * sizeof(PixelStatistics) / 4);
  grow(memory_, smooth_, pixels * sizeof(SmoothStatistics) / 4);
  grow(memory_, squares_, pixels + 1);
  push_ = {};
  push_.images = images_.address();
  push_.guides = memory_.address(*guides_);
  push_.moments = memory_.address(*sums_);
  push_.smoothed = memory_.address(*smooth_);
  push_.squares = memory_.address(*squares_);
  push_.lists = blurs_ ? 0u : 1u;
  push_.count = uint32_t(pixels);
  push_.width = launch.width;
  push_.height = launch.height;
}

void Denoiser::guide(ks::Commands& commands, const WaveRays& centre) {
  GuidePush push{};
  push.rays = centre.rays;
  push.scene = centre.scene;
  push.views = centre.views;
  push.guides = memory_.address(*guides_);
  push.range = centre.range;
  push.count = centre.range.pixel_count;
  push.infrared = infrared_ ? 1u : 0u;
  if (accumulates_) history_.describe(push);
  guide_.run(commands, "guide", push);
}

void Denoiser::moments(ks::Commands& commands, uint64_t state, const WaveRange& range, uint32_t groups, bool first_pass) {
  moments_.run(commands, "denoise",
               {.state = state,
                .moments = memory_.address(*sums_),
                .range = range,
                .count = range.pixel_count,
                .channels = channels_,
                .groups = groups,
                .first_pass = first_pass ? 1u : 0u});
}

void Denoiser::filter(ks::Commands& commands, uint32_t samples) {
  push_.samples = samples;
  if (!memory_.on_host) commands.fill(*squares_, 0, 4, 0);
  step(commands, denoise_divide);
  if (memory_.on_host) list_squares();
  step(commands, denoise_despeckle);
  if (accumulates_) {
    step(commands, denoise_smooth, 1);
    step(commands, denoise_accumulate);
    history_.end();
  }
  for (uint32_t pass = 0; pass < passes; ++pass) {
    step(commands, denoise_smooth, 1u << pass);
    step(commands, denoise_atrous, 1u << pass);
  }
}

void Denoiser::list_squares() const {
  const auto* pixels = static_cast<const PixelStatistics*>(pixels_[1]->mapped());
  auto* list = static_cast<uint32_t*>(squares_->mapped());
  list[0] = 0;
  for (uint32_t i = 0; i < push_.count; ++i)
    if (pixels[i].square != square_plain) list[++list[0]] = i;
}

uint32_t Denoiser::square_count(ks::Commands& commands) const {
  if (!memory_.device->is_cpu()) return push_.count;
  commands.flush();
  return *static_cast<const uint32_t*>(squares_->mapped());
}

// Each step reads what the step before wrote. Light and statistics stay where they are while levels are smoothed.
void Denoiser::step(ks::Commands& commands, uint32_t step, uint32_t spacing) {
  const bool smooths = step == denoise_smooth;
  if (!smooths) {
    std::swap(light_[0], light_[1]);
    std::swap(pixels_[0], pixels_[1]);
  }
  push_.light_in = memory_.address(*light_[0]);
  push_.light_out = memory_.address(*light_[1]);
  push_.pixels_in = memory_.address(*pixels_[smooths ? 1 : 0]);
  push_.pixels_out = memory_.address(*pixels_[1]);
  push_.step = step;
  push_.spacing = spacing;
  denoise_.run(commands, "denoise", push_, planes_ | push_.step << 8);
}

void Denoiser::blend(ks::Commands& commands, const WaveRays& square) { over_square(commands, square, square.range.pixel_count, true); }

void Denoiser::multiply(ks::Commands& commands) { step(commands, denoise_multiply); }

void Denoiser::remodulate(ks::Commands& commands, const WaveRays& square) {
  over_square(commands, square, square.range.pixel_count * square_rays, false);
}

void Denoiser::over_square(ks::Commands& commands, const WaveRays& square, uint32_t count, bool blends) {
  const uint64_t guides = memory_.address(*guides_);
  remodulate_.run(commands, blends ? "blend" : "remodulate",
                  {.rays = square.rays,
                   .scene = square.scene,
                   .views = square.views,
                   .images = images_.address(),
                   .guides = guides,
                   .light = push_.light_in,
                   .light_out = push_.light_out,
                   .pixels = push_.pixels_in,
                   .range = square.range,
                   .count = count,
                   .infrared = infrared_ ? 1u : 0u,
                   .samples = push_.samples,
                   .blends = blends ? 1u : 0u,
                   .squares_or_blended = blends ? guides : memory_.address(*squares_)},
                  planes_);
}

void Denoiser::sum(ks::Commands& commands) {
  push_.light_in = push_.light_out;
  push_.step = denoise_sum;
  denoise_.run(commands, "denoise", push_, planes_ | push_.step << 8);
}

}  // namespace kuafu
