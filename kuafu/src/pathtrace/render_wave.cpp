// One wave of paths through the stages: what each stage is told.
#include <algorithm>

#include "pathtrace/render_run.h"

namespace kuafu {

void PathTracer::Run::render_aovs(uint32_t first_pixel, uint32_t pixel_count) {
  const WaveRange centre = range(first_pixel, pixel_count, 0, 1);
  generate(centre, generate_pixel_centre);
  o_.tracer_->closest(commands_, o_.buffers_.closest_queue(0));
  if (denoises()) o_.denoiser_.guide(commands_, rays_of(centre));
  if (!launch_.wants_aovs()) return;
  const WaveBuffers& b = o_.buffers_;
  AovPush push{};
  push.rays = b.closest_rays(0);
  push.scene = o_.tables_.address();
  push.views = o_.views_.address();
  push.cameras = o_.cameras_.address();
  push.outputs = o_.outputs_.address();
  push.aov = o_.aov_tables_.address();
  push.shadow_rays = b.shadow_rays();
  push.shadow_environments = b.shadow_environments();
  push.counters = b.counter_address();
  push.range = centre;
  push.shadow_capacity = b.shadow_capacity();
  push.flags = (launch_.band.infrared ? aov_infrared : 0) | (launch_.wants_projector() ? aov_projector : 0) |
               (launch_.wants_visibility() ? aov_visibility : 0) | (launch_.wants_motion() ? aov_motion : 0) |
               (environments_ ? aov_environments : 0) | (camera_ ? aov_camera : 0);
  o_.stages_->aov(commands_, push);
  if (!launch_.wants_visibility()) return;
  o_.tracer_->occluded(commands_, b.shadow_queue(0));
  o_.stages_->visibility(commands_, push);
}

void PathTracer::Run::render_pixels(uint32_t first_pixel, uint32_t pixel_count) {
  const uint32_t samples = budget_.next();
  for (uint32_t sample = 0; sample < samples; sample += most_pass_samples()) {
    const uint32_t count = std::min(most_pass_samples(), samples - sample);
    const WaveRange wave = range(first_pixel, pixel_count, first_sample() + samples_before() + sample, count);
    generate(wave, launch_.wants_variance() ? generate_replicates : 0);
    trace_paths();
    if (launch_.denoise == DenoiseKind::atrous)
      o_.denoiser_.moments(commands_, o_.buffers_.state(), wave, o_.buffers_.size().groups, wave.first_sample == first_sample());
    accumulate(wave, sample + count == samples);
    if (sample + count == samples) break;
    commands_.flush();
    report(first_pixel, float(pixel_count) * float(sample + count) / float(samples));
  }
}

// Shadow rays and next rays of a bounce are both there after `shade`, so a host tracer answers them in one stop.
void PathTracer::Run::trace_paths() {
  const bool shadows = o_.tables_.shadow_rays_per_vertex() > 0;
  o_.tracer_->closest(commands_, o_.buffers_.closest_queue(0));
  for (uint32_t bounce = 0; bounce <= last_bounce(); ++bounce) {
    shade(bounce);
    if (shadows && bounce <= last_lit()) trace_shadows(bounce);
    if (o_.device_->is_cpu()) commands_.flush();  // then the host sees how many paths are left
    const bool more = bounce < last_bounce() && o_.buffers_.ray_count(bounce + 1) > 0;
    if (more) o_.tracer_->closest(commands_, o_.buffers_.closest_queue(bounce + 1));
    if (shadows && bounce <= last_lit()) resolve(bounce);
    if (!more) break;
  }
}

void PathTracer::Run::trace_shadows(uint32_t bounce) {
  const WaveBuffers& b = o_.buffers_;
  if (!glass_shadows()) return o_.tracer_->occluded(commands_, b.shadow_queue(bounce));
  const uint32_t surfaces = b.size().glass_surfaces;
  for (uint32_t passed = 0; passed <= surfaces; ++passed) {
    if (passed > 0 && o_.on_host_ && b.shadow_ray_count(bounce, passed) == 0) return;
    o_.tracer_->closest(commands_, b.shadow_queue(bounce, passed));
    const bool last = passed == surfaces;
    o_.stages_->transmit(commands_,
                         {b.shadow_rays(passed), b.shadow_rays(passed + 1), b.shadow_environments(passed),
                          b.shadow_environments(passed + 1), b.contributions(), b.counter_address(), o_.tables_.address(),
                          b.shadow_capacity(), b.shadow_block(bounce, passed), b.shadow_block(bounce, last ? passed : passed + 1),
                          environments_ ? 1u : 0u, last ? 1u : 0u, o_.tables_.has_medium() ? 1u : 0u, 0u},
                         b);
  }
}

void PathTracer::Run::generate(const WaveRange& wave, uint32_t flags) {
  const WaveBuffers& b = o_.buffers_;
  GeneratePush push{o_.views_.address(),
                    o_.cameras_.address(),
                    b.closest_rays(0),
                    b.closest_environments(0),
                    b.state(),
                    b.counter_address(),
                    wave,
                    b.size().channels,
                    b.size().groups,
                    flags};
  push.flags |= (environments_ ? generate_environments : 0) | (camera_ ? generate_camera : 0) | (o_.tables_.moves() ? generate_motion : 0);
  o_.stages_->generate(commands_, push, b);
}

void PathTracer::Run::shade(uint32_t bounce) {
  const WaveBuffers& b = o_.buffers_;
  ShadePush push{};
  push.rays_in = b.closest_rays(bounce);
  push.rays_out = b.closest_rays(bounce + 1);
  push.shadow_rays = b.shadow_rays();
  push.ray_environments = b.closest_environments(bounce + 1);
  push.shadow_environments = b.shadow_environments();
  push.contributions = b.contributions();
  push.state = b.state();
  push.counters = b.counter_address();
  push.scene = o_.tables_.address();
  push.capacity = b.size().capacity;
  push.shadow_capacity = b.shadow_capacity();
  push.bounce = bounce;
  push.max_bounces = launch_.max_bounces;
  push.shadow_rays_per_vertex = bounce <= last_lit() ? b.size().shadow_rays_per_vertex : 0;
  push.flags = (environments_ ? shade_environments : 0) | (o_.tables_.has_ambient() ? shade_ambient : 0) |
               (o_.tables_.select_lights() ? shade_select_lights : 0) | (glass_shadows() ? shade_glass_shadows : 0) |
               (o_.tables_.has_medium() ? shade_medium : 0) | (launch_.light_sampling == LightSampling::lights ? shade_lights_only : 0) |
               (launch_.light_sampling == LightSampling::bsdf ? shade_bsdf_only : 0);
  push.groups = b.size().groups;
  o_.stages_->shade(commands_, push, b);
}

void PathTracer::Run::resolve(uint32_t bounce) {
  const WaveBuffers& b = o_.buffers_;
  const ResolvePush push{b.closest_rays(bounce),
                         b.shadow_rays(),
                         b.contributions(),
                         b.state(),
                         b.counter_address(),
                         b.size().capacity,
                         b.shadow_capacity(),
                         bounce,
                         b.size().shadow_rays_per_vertex,
                         b.size().channels,
                         b.size().groups,
                         glass_shadows() ? 1u : 0u,
                         0};
  o_.stages_->resolve(commands_, push, b);
}

void PathTracer::Run::accumulate(const WaveRange& wave, bool last) {
  const WaveBuffers& b = o_.buffers_;
  AccumulatePush push{};
  push.state = b.state();
  push.sums = keeps_sums() ? o_.accumulation_.address() : b.sums();
  push.outputs = o_.outputs_.address();
  push.range = wave;
  push.channels = b.size().channels;
  push.groups = b.size().groups;
  push.flags = (wave.first_sample > first_sample() ? accumulate_continues : 0) | (keeps_sums() || !last ? accumulate_keeps : 0) |
               (last ? accumulate_writes : 0) | (launch_.wants_variance() ? accumulate_replicates : 0);
  push.sums_first = keeps_sums() ? wave.first_pixel : 0;
  push.sums_stride = keeps_sums() ? launch_.pixel_count() : wave.pixel_count;
  push.first_sample = first_sample();
  push.sample_count = wave.first_sample - first_sample() + wave.sample_count;
  push.inverse_samples = float(1.0 / push.sample_count);
  o_.stages_->accumulate(commands_, push);
}

}  // namespace kuafu
