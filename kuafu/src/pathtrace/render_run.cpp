// A render call as a whole: tables and memory, rounds of samples, steps on whole images.
#include "pathtrace/render_run.h"

#include <algorithm>

#include "device/error.h"
#include "device/thread_pool.h"
#include "pathtrace/wave.h"
#include "pathtrace/wave_size.h"

namespace kuafu {
namespace {

uint32_t round_up(uint32_t n, uint32_t step) { return (n + step - 1) / step * step; }

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

void PathTracer::Run::prepare(const Scene& scene) {
  environments_ = launch_.environment_count() > 1;
  auto start = std::chrono::steady_clock::now();
  const TimeSpan open = open_span(launch_);
  o_.tables_.update(scene, launch_.band, launch_.environment_count(), open);
  check_countable();
  o_.aov_tables_.update(scene, launch_);
  const auto views = o_.views_.resize(o_.memory(), launch_.views.size());
  for (size_t i = 0; i < launch_.views.size(); ++i) views[i] = view_record(launch_, launch_.views[i]);
  camera_ = o_.tables_.moves() || std::ranges::any_of(launch_.views, &View::special);
  const auto cameras = o_.cameras_.resize(o_.memory(), camera_ ? launch_.views.size() : 0);
  for (size_t i = 0; i < cameras.size(); ++i) cameras[i] = camera_record(launch_.views[i]);
  const auto outputs = o_.outputs_.resize(o_.memory(), output_kind_count);
  o_.frame_.fit(launch_);
  for (uint32_t kind = 0; kind < output_kind_count; ++kind) outputs[kind] = o_.frame_.target(launch_, kind);
  fit_buffers();
  begin_accumulation();
  if (denoises()) o_.denoiser_.fit(launch_, scene, o_.frame_);
  commands_.add_host_time("upload", milliseconds_since(start));
  start = std::chrono::steady_clock::now();
  o_.tracer_->update(scene, launch_.environment_count(), open);
  commands_.add_host_time("acceleration build", milliseconds_since(start));
}

/// Stages count an image's words in 32 bits, and its elements with a sign.
void PathTracer::Run::check_countable() const {
  const auto check = [&](const char* what, uint64_t words_per_pixel, uint64_t most) {
    if (launch_.pixel_count() * words_per_pixel > most)
      ks::fail(KS_ERROR_INVALID_ARGUMENT,
               "%s: %zu views of %u x %u pixels with %llu values each are more than %llu: render fewer views in a call, or smaller ones",
               what, launch_.views.size(), launch_.width, launch_.height, static_cast<unsigned long long>(words_per_pixel),
               static_cast<unsigned long long>(most));
  };
  for (uint32_t kind = 0; kind < output_kind_count; ++kind)
    if (o_.frame_.needs(launch_, kind))
      check("images between the steps of a render", launch_.channels(kind), std::numeric_limits<int32_t>::max());
  if (keeps_sums()) check("accumulation and budgets", sum_planes(), std::numeric_limits<uint32_t>::max());
  if (denoises()) check("the denoiser", uint64_t(most_denoised) * 3, std::numeric_limits<uint32_t>::max());
}

void PathTracer::Run::fit_buffers() {
  const uint32_t shadows = o_.tables_.shadow_rays_per_vertex(), total = launch_.pixel_count();
  const uint32_t samples = launch_.wants_radiance() ? std::min(launch_.samples, most_pass_samples()) : 1;
  const uint32_t paths = o_.on_host_ ? host_wave_paths(shadows) : most_paths(*o_.device_, shadows);
  const uint32_t wave = std::min(total, std::max(paths / samples, pixel_block));
  // A fourth of the pixels in one wave: rays over squares seldom ask for more, and each wave ends in a tail.
  const uint32_t squares = denoises() && !o_.on_host_ ? std::min(total / 4 * square_rays, paths) : 0;
  pixels_per_batch_ = o_.on_host_ ? std::min(total, wave * waves_per_worker * o_.device_->workers().size()) : wave;
  o_.slots_.fit({round_up(std::max(wave * samples, squares), pixel_block), launch_.band.channels(), groups(), shadows,
                 launch_.max_bounces + 3 + o_.tables_.walk_passes(), environments_, o_.tables_.features(), launch_.wants_visibility(),
                 passes_glass() && !o_.tracer_->passes_glass() ? launch_.glass_surfaces : 0});
  grow(o_.memory(), o_.sums_, keeps_sums() ? 0 : uint64_t(pixels_per_batch_) * sum_planes());
}

void PathTracer::Run::begin_accumulation() {
  if (!keeps_sums()) {
    if (!launch_.accumulate) o_.accumulation_.clear();  // else only AOVs are asked for: what there is waits for the next call
    return;
  }
  o_.accumulation_.begin({uint32_t(launch_.views.size()), launch_.width, launch_.height, launch_.band.channels(), groups(),
                          launch_.wants_variance(), launch_.denoise == DenoiseKind::atrous},
                         launch_.accumulate, launch_.first_sample);
  const uint64_t end = uint64_t(first_sample()) + samples_before() + launch_.samples;
  if (end > std::numeric_limits<uint32_t>::max())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "samples would go up to %llu, beyond 2^32 - 1: accumulate anew",
             static_cast<unsigned long long>(end));
}

void PathTracer::Run::render() {
  while (budget_.next() > 0) {
    render_round();
    finish_round();
  }
  if (!o_.frame_.is_empty()) develop();
  commands_.flush();
  o_.slots_.collect_times(commands_);
}

void PathTracer::Run::finish_round() {
  if (launch_.has_budget()) commands_.flush();  // images and time are looked at
  if (keeps_sums()) o_.accumulation_.add(budget_.next());
  if (launch_.relative_error > 0)
    relative_error_ = kuafu::relative_error(o_.frame_.image(output_variance), o_.frame_.image(output_radiance), launch_.pixel_count(),
                                            launch_.band.channels());
  budget_.round_done(seconds(), samples_before(), relative_error_);
}

void PathTracer::Run::render_round() {
  const uint32_t total = launch_.pixel_count();
  for (uint32_t first = 0; first < total; first += pixels_per_batch_) {
    const uint32_t count = std::min(pixels_per_batch_, total - first);
    if ((launch_.wants_aovs() || denoises()) && budget_.done() == 0)
      in_waves(range(first, count, 0, 1), [](Wave& wave) { wave.render_aovs(); });
    if (launch_.wants_radiance()) render_pixels(first, count);
    if (ends_submission(first / pixels_per_batch_)) commands_.flush();
    report(first, float(count));
  }
}

void PathTracer::Run::render_pixels(uint32_t first_pixel, uint32_t pixel_count) {
  const uint32_t samples = budget_.next();
  for (uint32_t sample = 0; sample < samples; sample += most_pass_samples()) {
    const uint32_t count = std::min(most_pass_samples(), samples - sample);
    const bool last = sample + count == samples;
    in_waves(range(first_pixel, pixel_count, first_sample() + samples_before() + sample, count),
             [last](Wave& wave) { wave.render_paths(last); });
    if (last) break;
    commands_.flush();
    report(first_pixel, float(pixel_count) * float(sample + count) / float(samples));
  }
}

void PathTracer::Run::in_waves(const WaveRange& batch, const std::function<void(Wave&)>& step) {
  batch_ = batch;
  if (!o_.on_host_) {
    Wave wave(*this, o_.slots_.only(), commands_, batch);
    return step(wave);
  }
  const uint32_t pixels = batch.capacity / batch.sample_count;
  o_.device_->workers().parallel_for((batch.pixel_count + pixels - 1) / pixels, [&](size_t i) {
    WaveRange range = batch;
    range.first_pixel += uint32_t(i) * pixels;
    range.pixel_count = std::min(pixels, batch.pixel_count - uint32_t(i) * pixels);
    const WaveSlots::Lease lease(o_.slots_);
    Wave wave(*this, lease.slot().buffers, *lease.slot().commands, range);
    step(wave);
  });
}

// Steps on whole images, in the order of the light: noise goes before the optics spread it, and the caller's format comes last.
void PathTracer::Run::develop() {
  if (denoises()) denoise();
  o_.film_.run(commands_, launch_, o_.frame_);
  for (uint32_t kind = 0; kind < output_kind_count; ++kind)
    if (launch_.outputs[kind].buffer && o_.frame_.holds(kind)) o_.stages_->write(commands_, o_.frame_.write(launch_, kind));
}

void PathTracer::Run::denoise() {
  if (o_.denoiser_.blurs()) in_squares(launch_.pixel_count(), [](Wave& wave) { wave.blend_guides(); });
  if (launch_.denoise == DenoiseKind::oidn) {
    commands_.flush();
    const auto start = std::chrono::steady_clock::now();
    o_.denoiser_.filter_by_oidn(launch_, o_.frame_);
    commands_.add_host_time("denoise", milliseconds_since(start));
    return o_.denoiser_.sum(commands_);
  }
  o_.denoiser_.filter(commands_, samples_before() + (keeps_sums() ? 0 : budget_.done()));
  o_.denoiser_.multiply(commands_);
  if (!o_.denoiser_.blurs()) in_squares(o_.denoiser_.square_count(commands_), [](Wave& wave) { wave.remodulate(); });
  o_.denoiser_.sum(commands_);
}

void PathTracer::Run::in_squares(uint32_t pixels, const std::function<void(Wave&)>& step) {
  const uint32_t batch = o_.on_host_ ? pixels_per_batch_ : std::max(1u, o_.slots_.size().capacity / square_rays);
  for (uint32_t first = 0; first < pixels; first += batch) {
    in_waves(range(first, std::min(batch, pixels - first), launch_.first_sample, square_rays), step);
    if (ends_submission(first / batch)) commands_.flush();
  }
}

void PathTracer::Run::report(uint32_t pixels_done, float part) {
  const float round = std::min(1.0f, (float(pixels_done) + part) / float(launch_.pixel_count()));
  const float fraction = (float(budget_.done()) + round * float(budget_.next())) / float(launch_.samples);
  if (launch_.cancelled && launch_.cancelled(fraction))
    ks::fail(KS_ERROR_CANCELLED, "the progress callback cancelled the render at %.0f %%", 100.0 * fraction);
}

WaveRange PathTracer::Run::range(uint32_t first_pixel, uint32_t pixel_count, uint32_t first_sample, uint32_t sample_count) const {
  const uint32_t blocks = launch_.pixel_count() / pixel_block;
  // Workers on the host take what is next, and GPUs deal out groups as they go: there neighbours share caches.
  const uint32_t stride = o_.on_host_ ? 1 : o_.device_->is_cpu() ? permutation_stride(blocks) : 0;
  return {first_pixel, pixel_count, blocks, stride, first_sample, sample_count, launch_.width, launch_.height, o_.slots_.size().capacity};
}

}  // namespace kuafu
