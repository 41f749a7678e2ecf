#include "pathtrace/wave.h"

namespace kuafu {

void PathTracer::Wave::render_aovs() {
  generate(generate_pixel_centre);
  trace_closest(0);
  if (run_.denoises()) o_.denoiser_.guide(commands_, rays());
  if (launch_.wants_aovs()) aov();
}

void PathTracer::Wave::aov() {
  AovPush push{};
  push.rays = b_.closest_rays(0);
  push.scene = o_.tables_.address();
  push.views = o_.views_.address();
  push.cameras = o_.cameras_.address();
  push.outputs = o_.outputs_.address();
  push.aov = o_.aov_tables_.address();
  push.shadow_rays = b_.shadow_rays();
  push.shadow_environments = b_.shadow_environments();
  push.counters = b_.counter_address();
  push.range = range_;
  push.shadow_capacity = b_.shadow_capacity();
  push.flags = (launch_.band.infrared ? aov_infrared : 0) | (launch_.wants_projector() ? aov_projector : 0) |
               (launch_.wants_visibility() ? aov_visibility : 0) | (launch_.wants_motion() ? aov_motion : 0) |
               (run_.environments_ ? aov_environments : 0) | (run_.camera_ ? aov_camera : 0);
  o_.stages_->aov(commands_, push);
  if (!launch_.wants_visibility()) return;
  commands_.begin_stage("trace occluded");
  o_.tracer_->occluded(commands_, b_.shadow_queue(0));
  o_.stages_->visibility(commands_, push);
}

void PathTracer::Wave::render_paths(bool last) {
  generate(launch_.wants_variance() ? generate_replicates : 0);
  trace_paths();
  if (launch_.denoise == DenoiseKind::atrous)
    o_.denoiser_.moments(commands_, b_.state(), range_, b_.size().groups, range_.first_sample == run_.first_sample());
  accumulate(last);
}

void PathTracer::Wave::blend_guides() {
  generate(generate_rays_only);
  trace_closest(0);
  o_.denoiser_.blend(commands_, rays());
}

void PathTracer::Wave::remodulate() {
  generate(generate_rays_only | generate_listed, o_.denoiser_.squares());
  trace_closest(0);
  o_.denoiser_.remodulate(commands_, rays());
}

// Shadow rays and next rays of a bounce are both there after `shade`, so a host tracer answers them in one stop, and a GPU traces both at
// once: the few long rays that each ends with then run beside each other.
void PathTracer::Wave::trace_paths() {
  const bool shadows = o_.tables_.shadow_rays_per_vertex() > 0;
  trace_closest(0);
  for (uint32_t bounce = 0; bounce <= run_.last_bounce(); ++bounce) {
    shade(bounce);
    const bool lit = shadows && bounce <= run_.last_lit();
    bool more = bounce < run_.last_bounce();
    if (lit && more && !o_.device_->is_cpu() && !glass_shadows()) {
      commands_.set_automatic_barriers(false);
      trace_shadows(bounce, "trace");
      commands_.set_automatic_barriers(true);
      trace_closest(bounce + 1, "trace");
    } else {
      if (lit) trace_shadows(bounce);
      if (o_.device_->is_cpu()) commands_.flush();  // then the host sees how many paths are left
      more = more && b_.ray_count(bounce + 1) > 0;
      if (more) trace_closest(bounce + 1);
    }
    if (lit) resolve(bounce);
    if (!more) break;
  }
}

void PathTracer::Wave::trace_closest(uint32_t bounce, const char* stage) {
  commands_.begin_stage(stage);
  o_.tracer_->closest(commands_, b_.closest_queue(bounce));
}

void PathTracer::Wave::trace_shadows(uint32_t bounce, const char* stage) {
  if (glass_shadows()) return trace_by_surfaces(bounce);
  commands_.begin_stage(stage);
  const RayQueue rays = b_.shadow_queue(bounce);
  if (!run_.passes_glass()) return o_.tracer_->occluded(commands_, rays);
  o_.tracer_->occluded_by_more_than_glass(commands_, rays,
                                          {b_.contributions(), o_.tables_.address(), launch_.glass_surfaces, b_.size().features,
                                           launch_.band.infrared, o_.tables_.has_medium()});
}

void PathTracer::Wave::trace_by_surfaces(uint32_t bounce) {
  const uint32_t surfaces = b_.size().glass_surfaces;
  for (uint32_t passed = 0; passed <= surfaces; ++passed) {
    if (passed > 0 && o_.on_host_ && b_.shadow_ray_count(bounce, passed) == 0) return;
    commands_.begin_stage("trace closest");
    o_.tracer_->closest(commands_, b_.shadow_queue(bounce, passed));
    const bool last = passed == surfaces;
    o_.stages_->transmit(commands_,
                         {b_.shadow_rays(passed), b_.shadow_rays(passed + 1), b_.shadow_environments(passed),
                          b_.shadow_environments(passed + 1), b_.contributions(), b_.counter_address(), o_.tables_.address(),
                          b_.shadow_capacity(), b_.shadow_block(bounce, passed), b_.shadow_block(bounce, last ? passed : passed + 1),
                          run_.environments_ ? 1u : 0u, last ? 1u : 0u, o_.tables_.has_medium() ? 1u : 0u, 0u},
                         b_);
  }
}

void PathTracer::Wave::generate(uint32_t flags, uint64_t pixels) {
  GeneratePush push{o_.views_.address(),
                    o_.cameras_.address(),
                    b_.closest_rays(0),
                    b_.closest_environments(0),
                    b_.state(),
                    b_.counter_address(),
                    pixels,
                    range_,
                    b_.size().channels,
                    b_.size().groups,
                    flags};
  push.flags |=
      (run_.environments_ ? generate_environments : 0) | (run_.camera_ ? generate_camera : 0) | (o_.tables_.moves() ? generate_motion : 0);
  o_.stages_->generate(commands_, push, b_);
}

void PathTracer::Wave::shade(uint32_t bounce) {
  ShadePush push{};
  push.rays_in = b_.closest_rays(bounce);
  push.rays_out = b_.closest_rays(bounce + 1);
  push.shadow_rays = b_.shadow_rays();
  push.ray_environments = b_.closest_environments(bounce + 1);
  push.shadow_environments = b_.shadow_environments();
  push.contributions = b_.contributions();
  push.state = b_.state();
  push.counters = b_.counter_address();
  push.scene = o_.tables_.address();
  push.capacity = b_.size().capacity;
  push.shadow_capacity = b_.shadow_capacity();
  push.bounce = bounce;
  push.max_bounces = launch_.max_bounces;
  push.shadow_rays_per_vertex = bounce <= run_.last_lit() ? b_.size().shadow_rays_per_vertex : 0;
  push.flags = (run_.environments_ ? shade_environments : 0) | (o_.tables_.has_ambient() ? shade_ambient : 0) |
               (o_.tables_.select_lights() ? shade_select_lights : 0) | (glass_shadows() ? shade_glass_shadows : 0) |
               (o_.tables_.has_medium() ? shade_medium : 0) | (launch_.light_sampling == LightSampling::lights ? shade_lights_only : 0) |
               (launch_.light_sampling == LightSampling::bsdf ? shade_bsdf_only : 0);
  push.groups = b_.size().groups;
  o_.stages_->shade(commands_, push, b_);
}

void PathTracer::Wave::resolve(uint32_t bounce) {
  const ResolvePush push{b_.closest_rays(bounce),
                         b_.shadow_rays(),
                         b_.contributions(),
                         b_.state(),
                         b_.counter_address(),
                         b_.size().capacity,
                         b_.shadow_capacity(),
                         bounce,
                         b_.size().shadow_rays_per_vertex,
                         b_.size().channels,
                         b_.size().groups,
                         glass_shadows() ? 1u : 0u,
                         0};
  o_.stages_->resolve(commands_, push, b_);
}

void PathTracer::Wave::accumulate(bool last) {
  AccumulatePush push{};
  push.state = b_.state();
  push.sums = run_.keeps_sums() ? o_.accumulation_.address() : o_.memory().address(*o_.sums_);
  push.outputs = o_.outputs_.address();
  push.range = range_;
  push.channels = b_.size().channels;
  push.groups = b_.size().groups;
  push.flags = (range_.first_sample > run_.first_sample() ? accumulate_continues : 0) |
               (run_.keeps_sums() || !last ? accumulate_keeps : 0) | (last ? accumulate_writes : 0) |
               (launch_.wants_variance() ? accumulate_replicates : 0);
  push.sums_first = run_.keeps_sums() ? range_.first_pixel : range_.first_pixel - run_.batch_.first_pixel;
  push.sums_stride = run_.keeps_sums() ? launch_.pixel_count() : run_.batch_.pixel_count;
  push.first_sample = run_.first_sample();
  push.sample_count = range_.first_sample - run_.first_sample() + range_.sample_count;
  push.inverse_samples = float(1.0 / push.sample_count);
  o_.stages_->accumulate(commands_, push);
}

}  // namespace kuafu
