// SPDX-License-Identifier: Apache-2.0
#include "pathtrace/path_tracer.h"

#include <algorithm>
#include <cmath>

#include "device/error.h"
#include "device/thread_pool.h"
#include "pathtrace/wave_size.h"

namespace kuafu {
namespace {

bool wants_embree(const ks::Device& device, TracerKind kind) {
  const bool embree = kind == TracerKind::embree || (kind == TracerKind::automatic && device.is_cpu());
  if (embree && !device.is_cpu())
    ks::fail(KS_ERROR_UNSUPPORTED, "KUAFU_TRACER_EMBREE needs a CPU device, %s is none: use KUAFU_TRACER_AUTO", device.info().name);
  return embree;
}

std::unique_ptr<Tracer> make_tracer(const std::shared_ptr<ks::Device>& device, TracerKind kind) {
  if (wants_embree(*device, kind)) return make_embree_tracer(device);
  return kind == TracerKind::rt_pipeline ? make_rt_tracer(device) : make_compute_tracer(device);
}

/// The stages run where the rays are: with Embree on worker threads, else on the device.
WaveBackend make_backend(const std::shared_ptr<ks::Device>& device, TracerKind kind) {
  const bool on_host = wants_embree(*device, kind);
  std::unique_ptr<Tracer> tracer = make_tracer(device, kind);
  std::unique_ptr<Stages> stages = on_host ? make_host_stages(device) : make_device_stages(device, *tracer);
  return {.memory = {.device = device, .on_host = on_host}, .tracer = std::move(tracer), .stages = std::move(stages)};
}

/// A part of the paths, so that light takes a small part of the time, and of one view alone, so that others beside it change nothing.
uint32_t beams_of(const Launch& launch) {
  constexpr uint64_t paths_per_beam = 32, least = 1u << 14, most = 1u << 18;
  return uint32_t(std::clamp(uint64_t(launch.width) * launch.height * launch.samples / paths_per_beam, least, most));
}

uint32_t round_up(uint32_t n, uint32_t step) { return (n + step - 1) / step * step; }

}  // namespace

PathTracer::PathTracer(const std::shared_ptr<ks::Device>& device, TracerKind tracer)
    : backend_(make_backend(device, tracer)), tables_(memory()), aov_tables_(memory()), slots_(memory()), splats_(memory()) {}

void PathTracer::update_tables(const Scene& scene, const Launch& launch) {
  tables_.update(scene, launch.band, launch.environment_count(), open_span(launch));
  aov_tables_.update(scene, launch);
  const auto views = views_.resize(memory(), launch.views.size());
  for (size_t i = 0; i < views.size(); ++i) views[i] = view_record(launch, launch.views[i]);
  const bool special = tables_.moves() || std::ranges::any_of(launch.views, &View::special);
  const auto cameras = cameras_.resize(memory(), special ? launch.views.size() : 0);
  for (size_t i = 0; i < cameras.size(); ++i) cameras[i] = camera_record(launch.views[i]);
  plan_ = plan_of(launch, special);
  if (!plan_.bends) return;
  splats_.fit(
      make_beam_sources(tables_.sharp_lights(), tables_.glass_bodies(), tables_.radius_m(), launch.environment_count(), beams_of(launch)));
  plan_.bends = splats_.beam_count() > 0;
  plan_.splats = splats_.table();
}

WavePlan PathTracer::plan_of(const Launch& launch, bool special_cameras) const {
  const bool light_groups = launch.wants(output_light_group, output_light_group + light_group_count);
  const bool direct_apart = launch.wants(output_ambient_direct, output_ambient_direct + 1);
  const bool passes_glass = tables_.shadow_rays_per_vertex() > 0 && tables_.has_glass() && launch.glass_surfaces > 0;
  const uint32_t last_lit = launch.max_bounces + tables_.walk_passes();
  return {.scene = tables_.address(),
          .views = views_.address(),
          .cameras = cameras_.address(),
          .aov = aov_tables_.address(),
          .environments = launch.environment_count() > 1,
          .camera = special_cameras,
          .motion = tables_.moves(),
          .medium = tables_.has_medium(),
          .ambient = tables_.has_ambient(),
          .select_lights = tables_.select_lights(),
          .passes_glass = passes_glass,
          .bends = launch.wants_radiance() && passes_glass && tables_.has_bending() && !launch.straight_through_glass,
          .direct_apart = direct_apart,
          .features = tables_.features(),
          .groups = light_groups   ? group_ambient + tables_.light_groups()
                    : direct_apart ? group_count + 1
                                   : group_count,
          .shadow_rays_per_vertex = tables_.shadow_rays_per_vertex(),
          .last_lit = last_lit,
          .last_bounce = last_lit + (tables_.has_ambient() ? 1 : 0)};
}

void PathTracer::fit(const Launch& launch, uint32_t rays_per_square) {
  rays_per_square_ = rays_per_square;
  const uint32_t total = launch.pixel_count();
  const uint32_t samples = launch.wants_radiance() ? std::min(launch.samples, most_pass_samples(launch.has_budget())) : 1;
  const bool by_surfaces = plan_.passes_glass && !backend_.tracer->passes_glass();
  WaveSize size{.queue_layout = backend_.tracer->queue_layout(),
                .channels = launch.band.channels(),
                .groups = plan_.groups,
                .shadow_rays_per_vertex = plan_.shadow_rays_per_vertex,
                .bounces = std::max(plan_.last_lit + 3, plan_.bends ? launch.glass_surfaces + 3 : 0),
                .environments = plan_.environments,
                .features = plan_.features,
                .visibility = launch.wants_visibility(),
                .glass_passes = by_surfaces ? launch.glass_surfaces : 0};
  const uint32_t paths = memory().on_host ? host_wave_paths(size.shadow_rays_per_vertex) : most_paths(*memory().device, size);
  const uint32_t most = std::min(total, std::max(paths / samples, pixel_block)), wave = memory().on_host ? most : even_wave(total, most);
  // One wave of a fourth of the pixels: seldom do more ask for rays over their squares, and each wave ends in a few slow rays.
  const uint32_t square_paths = memory().on_host ? 0 : std::min(total / 4 * rays_per_square, paths);
  pixels_per_batch_ = memory().on_host ? std::min(total, wave * waves_per_worker * memory().device->workers().size()) : wave;
  size.capacity = round_up(std::max(wave * samples, square_paths), pixel_block);
  slots_.fit(size);
}

void PathTracer::update_tracer(const Scene& scene, const Launch& launch) {
  backend_.tracer->update(scene, launch.environment_count(), open_span(launch));
  if (!launch.wants_radiance()) return;
  const WaveSize& size = slots_.size();
  backend_.tracer->prepare((plan_.features & feature_cutouts) != 0, size.shadow_rays_per_vertex > 0 && !plan_.passes_glass);
  backend_.stages->prepare(size, plan_.camera);
}

uint32_t PathTracer::squares_per_batch() const {
  return memory().on_host ? pixels_per_batch_ : std::max(1u, slots_.size().capacity / rays_per_square_);
}

void PathTracer::in_waves(ks::Commands& commands, const Launch& launch, const WaveRange& batch, const std::function<void(Wave&)>& step) {
  if (!memory().on_host) {
    Wave wave(backend_, launch, plan_, slots_.only(), commands, batch);
    return step(wave);
  }
  const uint32_t pixels = batch.capacity / batch.sample_count;
  memory().device->workers().parallel_for((batch.pixel_count + pixels - 1) / pixels, [&](size_t i) {
    WaveRange range = batch;
    range.first_pixel += uint32_t(i) * pixels;
    range.pixel_count = std::min(pixels, batch.pixel_count - uint32_t(i) * pixels);
    const WaveSlots::Lease lease(slots_);
    Wave wave(backend_, launch, plan_, lease.slot().buffers, *lease.slot().commands, range);
    step(wave);
  });
}

void PathTracer::splat_light(ks::Commands& commands, const Launch& launch, uint32_t first_sample) {
  if (!plan_.bends) return;
  // Grids of consecutive samples are moved by Roberts's sequence ("The unreasonable effectiveness of quasirandom sequences", 2018).
  const double u = double(launch.seed % 65521) / 65521 + first_sample * 0.7548776662466927;
  const double v = double(launch.seed % 65519) / 65519 + first_sample * 0.5698402909980532;
  BeamPush push = splats_.push(uint32_t(launch.seed ^ launch.seed >> 32) + 0x9e3779b9u * first_sample,
                               {float(u - std::floor(u)), float(v - std::floor(v))});
  const uint32_t capacity = slots_.size().capacity, total = splats_.beam_count();
  const auto follow = [&](WaveBuffers& buffers, ks::Commands& recorder, uint32_t first) {
    BeamPush part = push;
    part.first = first;
    part.count = std::min(capacity, total - first);
    Wave(backend_, launch, plan_, buffers, recorder, {}).follow_beams(part);
  };
  if (memory().on_host)
    memory().device->workers().parallel_for((total + capacity - 1) / capacity, [&](size_t i) {
      const WaveSlots::Lease lease(slots_);
      follow(lease.slot().buffers, *lease.slot().commands, uint32_t(i) * capacity);
    });
  else
    for (uint32_t first = 0; first < total; first += capacity) follow(slots_.only(), commands, first);
  backend_.stages->tabulate(commands, splats_);
}

WaveRange PathTracer::range(const Launch& launch, uint32_t first_pixel, uint32_t pixel_count, uint32_t first_sample,
                            uint32_t sample_count) const {
  const uint32_t blocks = launch.pixel_count() / pixel_block;
  // Workers on the host take what is next, and GPUs deal out groups as they go. On both, neighbours in the image then share caches.
  const uint32_t stride = memory().on_host ? 1 : memory().device->is_cpu() ? permutation_stride(blocks) : 0;
  return {.first_pixel = first_pixel,
          .pixel_count = pixel_count,
          .block_count = blocks,
          .block_stride = stride,
          .first_sample = first_sample,
          .sample_count = sample_count,
          .width = launch.width,
          .height = launch.height,
          .capacity = slots_.size().capacity};
}

}  // namespace kuafu
