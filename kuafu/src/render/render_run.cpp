// SPDX-License-Identifier: Apache-2.0
// This file takes a render call from its tables through its rounds of samples to the steps on whole images.
#include "render/render_run.h"

#include <algorithm>

#include "device/error.h"
#include "device/interrupt.h"
#include "pathtrace/wave_size.h"

namespace kuafu {
namespace {

/// Pixels that ask for rays over their squares come first, so that later batches are often empty, and a submission for each costs more.
constexpr uint32_t square_batches_at_once = 4;

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

void RenderRun::prepare(const Scene& scene) {
  auto start = std::chrono::steady_clock::now();
  parts_.paths.update_tables(scene, launch_);
  check_countable();
  parts_.frame.fit(launch_);
  parts_.paths.fit(launch_, denoises() ? square_rays : 0);
  grow(memory(), parts_.batch_sums, keeps_sums() ? 0 : uint64_t(parts_.paths.pixels_per_batch()) * sum_planes());
  begin_accumulation();
  if (denoises()) parts_.denoiser.fit(launch_, scene, parts_.frame);
  commands_.add_host_time("upload", milliseconds_since(start));
  start = std::chrono::steady_clock::now();
  parts_.paths.update_tracer(scene, launch_);
  commands_.add_host_time("acceleration build", milliseconds_since(start));
}

/// Throws for launches whose images are too large: stages count the words of an image in 32 bits, and its elements with a sign.
void RenderRun::check_countable() const {
  const auto check = [&](const char* what, uint64_t words_per_pixel, uint64_t most) {
    if (launch_.pixel_count() * words_per_pixel > most)
      ks::fail(KS_ERROR_INVALID_ARGUMENT,
               "%s: %zu views of %u x %u pixels with %llu values each are more than %llu: render fewer views in a call, or smaller ones",
               what, launch_.views.size(), launch_.width, launch_.height, static_cast<unsigned long long>(words_per_pixel),
               static_cast<unsigned long long>(most));
  };
  for (uint32_t kind = 0; kind < output_kind_count; ++kind)
    if (Frame::needs(launch_, kind))
      check("images between the steps of a render", launch_.channels(kind), std::numeric_limits<int32_t>::max());
  if (keeps_sums()) check("accumulation and budgets", sum_planes(), std::numeric_limits<uint32_t>::max());
  if (denoises()) check("the denoiser", uint64_t(most_denoised) * 3, std::numeric_limits<uint32_t>::max());
}

void RenderRun::begin_accumulation() {
  if (!keeps_sums()) {
    if (!launch_.accumulate) parts_.accumulation.clear();  // a call that asks for AOVs alone leaves the sums to the next
    return;
  }
  parts_.accumulation.begin({.views = uint32_t(launch_.views.size()),
                             .width = launch_.width,
                             .height = launch_.height,
                             .channels = launch_.band.channels(),
                             .groups = parts_.paths.plan().groups,
                             .replicates = launch_.wants_variance(),
                             .denoised = launch_.denoise == DenoiseKind::atrous},
                            launch_.accumulate, launch_.first_sample);
  const uint64_t end = uint64_t(first_sample()) + samples_before() + launch_.samples;
  if (end > std::numeric_limits<uint32_t>::max())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "samples would go up to %llu, beyond 2^32 - 1: begin a new sum",
             static_cast<unsigned long long>(end));
}

void RenderRun::render() {
  while (budget_.next() > 0) {
    render_round();
    finish_round();
  }
  if (!parts_.frame.is_empty()) develop();
  commands_.flush();
  report(launch_.pixel_count(), 0.0f);
  parts_.paths.collect_times(commands_);
}

void RenderRun::finish_round() {
  if (keeps_sums()) parts_.accumulation.add(budget_.next());
  if (launch_.relative_error > 0)
    relative_error_ = kuafu::relative_error(parts_.frame.image(output_variance), parts_.frame.image(output_radiance), launch_.pixel_count(),
                                            launch_.band.channels());
  budget_.round_done(seconds(), samples_before(), relative_error_);
}

void RenderRun::render_round() {
  const uint32_t total = launch_.pixel_count(), batch = parts_.paths.pixels_per_batch();
  if (launch_.wants_radiance()) parts_.paths.splat_light(commands_, launch_, first_sample() + samples_before());
  for (uint32_t first = 0; first < total; first += batch) {
    const uint32_t count = std::min(batch, total - first);
    if ((launch_.wants_aovs() || denoises()) && budget_.done() == 0) render_surfaces(first, count);
    if (launch_.wants_radiance()) render_pixels(first, count);
    if (first + count == total && !launch_.has_budget()) return;  // its submission has what follows on whole images, too
    commands_.flush();  // a caller who wants to end waits for no more than a batch, and no watchdog minds
    report(first, float(count));
  }
}

/// Rays through pixel centres give the AOVs and the denoiser's guides.
void RenderRun::render_surfaces(uint32_t first_pixel, uint32_t pixel_count) {
  parts_.paths.in_waves(commands_, launch_, parts_.paths.range(launch_, first_pixel, pixel_count, 0, 1), [this](Wave& wave) {
    wave.trace_centres();
    if (denoises()) parts_.denoiser.guide(wave.commands(), wave.rays());
    if (launch_.wants_aovs()) wave.write_aovs(parts_.frame.outputs());
  });
}

void RenderRun::render_pixels(uint32_t first_pixel, uint32_t pixel_count) {
  const uint32_t samples = budget_.next(), most_samples = most_pass_samples(launch_.has_budget());
  const PixelSums sums = sums_of(first_pixel, pixel_count);
  for (uint32_t sample = 0; sample < samples; sample += most_samples) {
    const uint32_t count = std::min(most_samples, samples - sample), first = first_sample() + samples_before() + sample;
    const bool last = sample + count == samples;
    parts_.paths.in_waves(commands_, launch_, parts_.paths.range(launch_, first_pixel, pixel_count, first, count), [&](Wave& wave) {
      wave.trace_paths();
      if (launch_.denoise == DenoiseKind::atrous)
        parts_.denoiser.moments(wave.commands(), wave.state(), wave.range(), parts_.paths.plan().groups, first == first_sample());
      wave.accumulate(sums, parts_.frame.outputs(), last);
    });
    if (last) break;
    commands_.flush();
    report(first_pixel, float(pixel_count) * float(sample + count) / float(samples));
  }
}

PixelSums RenderRun::sums_of(uint32_t first_pixel, uint32_t pixel_count) const {
  if (keeps_sums())
    return {.address = parts_.accumulation.address(),
            .first_pixel = 0,
            .pixel_count = launch_.pixel_count(),
            .first_sample = first_sample(),
            .outlive_call = true};
  return {.address = memory().address(*parts_.batch_sums),
          .first_pixel = first_pixel,
          .pixel_count = pixel_count,
          .first_sample = first_sample(),
          .outlive_call = false};
}

// The steps on whole images follow the light: noise goes before the optics spread it, and the caller's format comes last.
void RenderRun::develop() {
  if (denoises()) denoise();
  parts_.optics.run(commands_, launch_, parts_.frame);
  parts_.frame.deliver(commands_, launch_);
}

void RenderRun::denoise() {
  Denoiser& denoiser = parts_.denoiser;
  if (denoiser.blurs())
    in_squares(launch_.pixel_count(), [&](Wave& wave) {
      wave.trace_squares(0);
      denoiser.blend(wave.commands(), wave.rays());
    });
  if (launch_.denoise == DenoiseKind::oidn) {
    commands_.flush();
    const auto start = std::chrono::steady_clock::now();
    denoiser.filter_by_oidn(launch_, parts_.frame);
    commands_.add_host_time("denoise", milliseconds_since(start));
    return denoiser.sum(commands_);
  }
  denoiser.filter(commands_, all_samples());
  denoiser.multiply(commands_);
  if (!denoiser.blurs())
    in_squares(denoiser.square_count(commands_), [&](Wave& wave) {
      wave.trace_squares(denoiser.squares());
      denoiser.remodulate(wave.commands(), wave.rays());
    });
  denoiser.sum(commands_);
}

void RenderRun::in_squares(uint32_t pixels, const std::function<void(Wave&)>& step) {
  const uint32_t batch = parts_.paths.squares_per_batch();
  uint32_t recorded = 0;
  for (uint32_t first = 0; first < pixels; first += batch) {
    const uint32_t count = std::min(batch, pixels - first);
    parts_.paths.in_waves(commands_, launch_, parts_.paths.range(launch_, first, count, launch_.first_sample, square_rays), step);
    if (++recorded % square_batches_at_once == 0 && first + count < pixels) commands_.flush();
  }
}

void RenderRun::report(uint32_t pixels_done, float part) {
  const float round = std::min(1.0f, (float(pixels_done) + part) / float(launch_.pixel_count()));
  const float fraction = (float(budget_.done()) + round * float(budget_.next())) / float(launch_.samples);
  if (ks::Interrupt* interrupt = ks::Interrupt::current()) interrupt->report(fraction);
}

}  // namespace kuafu
