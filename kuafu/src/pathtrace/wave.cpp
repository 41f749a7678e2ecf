// SPDX-License-Identifier: Apache-2.0
#include "pathtrace/wave.h"

namespace kuafu {
namespace {

uint32_t flag(bool set, uint32_t bit) { return set ? bit : 0; }

}  // namespace

void Wave::trace_centres() {
  generate(generate_pixel_centre);
  trace_closest(0);
}

void Wave::trace_squares(uint64_t listed) {
  generate(generate_rays_only | flag(listed != 0, generate_listed), listed);
  trace_closest(0);
}

void Wave::write_aovs(uint64_t outputs) {
  const AovPush push{.rays = buffers_.closest_rays(0),
                     .scene = plan_.scene,
                     .views = plan_.views,
                     .cameras = plan_.cameras,
                     .outputs = outputs,
                     .aov = plan_.aov,
                     .shadow_rays = buffers_.shadow_rays(),
                     .shadow_environments = buffers_.shadow_environments(),
                     .counters = buffers_.counter_address(),
                     .range = range_,
                     .shadow_capacity = buffers_.shadow_capacity(),
                     .flags = flag(launch_.band.infrared, aov_infrared) | flag(launch_.wants_projector(), aov_projector) |
                              flag(launch_.wants_visibility(), aov_visibility) | flag(launch_.wants_motion(), aov_motion) |
                              flag(plan_.environments, aov_environments) | flag(plan_.camera, aov_camera)};
  backend_.stages->aov(commands_, push);
  if (!launch_.wants_visibility()) return;
  commands_.begin_stage("trace occluded");
  backend_.tracer->occluded(commands_, of_scene(buffers_.shadow_queue(0)));
  backend_.stages->visibility(commands_, push);
}

// The shadow rays and the next rays of a bounce are both there after `shade`. So a host tracer answers them in one stop, and a GPU traces
// both at once: the few long rays that each queue ends with then run beside each other.
void Wave::trace_paths() {
  generate(flag(launch_.wants_variance(), generate_replicates));
  trace_closest(0);
  for (uint32_t bounce = 0; bounce <= plan_.last_bounce; ++bounce) {
    const bool lit = plan_.shadow_rays_per_vertex > 0 && bounce <= plan_.last_lit;
    if (lit && plan_.bends) backend_.stages->gather(commands_, shade_push(bounce), buffers_);
    shade(bounce);
    bool more = bounce < plan_.last_bounce;
    if (lit && more && !on_cpu_device() && !glass_shadows()) {
      commands_.set_automatic_barriers(false);
      trace_shadows(bounce, "trace");
      commands_.set_automatic_barriers(true);
      trace_closest(bounce + 1, "trace");
    } else {
      if (lit) trace_shadows(bounce);
      if (on_cpu_device()) commands_.flush();  // then the host sees how many paths are left
      more = more && buffers_.ray_count(bounce + 1) > 0;
      if (more) trace_closest(bounce + 1);
    }
    if (lit) resolve(bounce);
    if (!more) break;
  }
}

/// A queue's rays ask the scene's materials where surfaces are not everywhere there.
RayQueue Wave::of_scene(RayQueue rays) const {
  if ((plan_.features & feature_cutouts) != 0) rays.scene = plan_.scene;
  return rays;
}

void Wave::trace_closest(uint32_t bounce, const char* stage) {
  commands_.begin_stage(stage);
  backend_.tracer->closest(commands_, of_scene(buffers_.closest_queue(bounce)));
}

void Wave::trace_shadows(uint32_t bounce, const char* stage) {
  if (glass_shadows()) return trace_by_surfaces(bounce);
  commands_.begin_stage(stage);
  const RayQueue rays = of_scene(buffers_.shadow_queue(bounce));
  if (!plan_.passes_glass) return backend_.tracer->occluded(commands_, rays);
  backend_.tracer->occluded_by_more_than_glass(commands_, rays,
                                               {.contributions = buffers_.contributions(),
                                                .scene = plan_.scene,
                                                .surfaces = launch_.glass_surfaces,
                                                .features = plan_.features,
                                                .infrared = launch_.band.infrared,
                                                .medium = plan_.medium});
}

void Wave::trace_by_surfaces(uint32_t bounce) {
  const uint32_t passes = buffers_.size().glass_passes;
  for (uint32_t passed = 0; passed <= passes; ++passed) {
    if (passed > 0 && backend_.memory.on_host && buffers_.shadow_ray_count(bounce, passed) == 0) return;
    commands_.begin_stage("trace closest");
    backend_.tracer->closest(commands_, of_scene(buffers_.shadow_queue(bounce, passed)));
    const bool last = passed == passes;
    backend_.stages->transmit(commands_,
                              {.rays_in = buffers_.shadow_rays(passed),
                               .rays_out = buffers_.shadow_rays(passed + 1),
                               .environments_in = buffers_.shadow_environments(passed),
                               .environments_out = buffers_.shadow_environments(passed + 1),
                               .contributions = buffers_.contributions(),
                               .counters = buffers_.counter_address(),
                               .scene = plan_.scene,
                               .capacity = buffers_.shadow_capacity(),
                               .block_in = buffers_.shadow_block(bounce, passed),
                               .block_out = buffers_.shadow_block(bounce, last ? passed : passed + 1),
                               .has_environments = flag(plan_.environments, 1),
                               .last = flag(last, 1),
                               .has_medium = flag(plan_.medium, 1)},
                              buffers_);
  }
}

void Wave::follow_beams(BeamPush push) {
  push.counters = buffers_.counter_address();
  push.scene = plan_.scene;
  push.capacity = buffers_.size().capacity;
  push.surfaces = launch_.glass_surfaces;
  push.flags = flag(plan_.environments, beam_environments) | flag(plan_.medium, beam_medium);
  for (uint32_t passed = 0; passed <= launch_.glass_surfaces; ++passed) {
    push.rays_in = buffers_.closest_rays(passed);
    push.environments_in = buffers_.closest_environments(passed);
    if (passed == 0) {
      push.rays_out = push.rays_in;
      push.environments_out = push.environments_in;
      backend_.stages->send(commands_, push, buffers_);
    }
    push.rays_out = buffers_.closest_rays(passed + 1);
    push.environments_out = buffers_.closest_environments(passed + 1);
    push.block = passed;
    trace_closest(passed);
    backend_.stages->follow(commands_, push, buffers_);
    if (on_cpu_device()) commands_.flush();  // then the host sees how many are left
    if (buffers_.ray_count(passed + 1) == 0) return;
  }
}

void Wave::generate(uint32_t flags, uint64_t pixels) {
  backend_.stages->generate(commands_,
                            {.views = plan_.views,
                             .cameras = plan_.cameras,
                             .rays = buffers_.closest_rays(0),
                             .ray_environments = buffers_.closest_environments(0),
                             .state = buffers_.state(),
                             .counters = buffers_.counter_address(),
                             .pixels = pixels,
                             .range = range_,
                             .channels = buffers_.size().channels,
                             .groups = plan_.groups,
                             .flags = flags | flag(plan_.environments, generate_environments) | flag(plan_.camera, generate_camera) |
                                      flag(plan_.motion, generate_motion),
                             .blur_px = launch_.pixel_blur_px},
                            buffers_);
}

void Wave::shade(uint32_t bounce) { backend_.stages->shade(commands_, shade_push(bounce), buffers_); }

ShadePush Wave::shade_push(uint32_t bounce) const {
  return {.rays_in = buffers_.closest_rays(bounce),
          .rays_out = buffers_.closest_rays(bounce + 1),
          .shadow_rays = buffers_.shadow_rays(),
          .ray_environments = buffers_.closest_environments(bounce + 1),
          .shadow_environments = buffers_.shadow_environments(),
          .contributions = buffers_.contributions(),
          .state = buffers_.state(),
          .counters = buffers_.counter_address(),
          .scene = plan_.scene,
          .capacity = buffers_.size().capacity,
          .shadow_capacity = buffers_.shadow_capacity(),
          .bounce = bounce,
          .max_bounces = launch_.max_bounces,
          .shadow_rays_per_vertex = bounce <= plan_.last_lit ? plan_.shadow_rays_per_vertex : 0,
          .flags = flag(plan_.environments, shade_environments) | flag(plan_.ambient, shade_ambient) |
                   flag(plan_.select_lights, shade_select_lights) | flag(glass_shadows(), shade_glass_shadows) |
                   flag(plan_.medium, shade_medium) | flag(launch_.light_sampling == LightSampling::lights, shade_lights_only) |
                   flag(launch_.light_sampling == LightSampling::bsdf, shade_bsdf_only) | flag(plan_.bends, shade_bends) |
                   flag(plan_.direct_apart, shade_direct_apart),
          .groups = plan_.groups,
          .reserved = 0,
          .splats = plan_.splats};
}

void Wave::resolve(uint32_t bounce) {
  backend_.stages->resolve(commands_,
                           {.rays = buffers_.closest_rays(bounce),
                            .shadow_rays = buffers_.shadow_rays(),
                            .contributions = buffers_.contributions(),
                            .state = buffers_.state(),
                            .counters = buffers_.counter_address(),
                            .capacity = buffers_.size().capacity,
                            .shadow_capacity = buffers_.shadow_capacity(),
                            .bounce = bounce,
                            .shadow_rays_per_vertex = plan_.shadow_rays_per_vertex,
                            .channels = buffers_.size().channels,
                            .groups = plan_.groups,
                            .glass_shadows = flag(glass_shadows(), 1),
                            .reserved = 0},
                           buffers_);
}

void Wave::accumulate(const PixelSums& sums, uint64_t outputs, bool last) {
  const uint32_t sample_count = range_.first_sample - sums.first_sample + range_.sample_count;
  backend_.stages->accumulate(commands_, {.state = buffers_.state(),
                                          .sums = sums.address,
                                          .outputs = outputs,
                                          .range = range_,
                                          .channels = buffers_.size().channels,
                                          .groups = plan_.groups,
                                          .flags = flag(range_.first_sample > sums.first_sample, accumulate_continues) |
                                                   flag(sums.outlive_call || !last, accumulate_keeps) | flag(last, accumulate_writes) |
                                                   flag(launch_.wants_variance(), accumulate_replicates),
                                          .sums_first = range_.first_pixel - sums.first_pixel,
                                          .sums_stride = sums.pixel_count,
                                          .first_sample = sums.first_sample,
                                          .sample_count = sample_count,
                                          .inverse_samples = float(1.0 / sample_count),
                                          .reserved = 0});
}

}  // namespace kuafu
