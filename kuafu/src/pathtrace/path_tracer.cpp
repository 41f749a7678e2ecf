#include "pathtrace/path_tracer.h"

#include <algorithm>
#include <chrono>
#include <numeric>

#include "device/error.h"
#include "pathtrace/budget.h"

namespace kuafu {
namespace {

// Paths in flight that measured best: enough to fill the device, few enough for a CPU's caches.
constexpr uint32_t cpu_wave = 1u << 17, gpu_wave = 1u << 22;
constexpr uint64_t path_bytes = 320;          // of queues and state, about
constexpr uint32_t pass_samples = 256;        // most samples of a pixel in one wave; fixed, since the order of sums follows from it
constexpr uint32_t budget_pass_samples = 32;  // the same where a budget renders in rounds, which are short

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

/// Near the golden section of n, coprime to it, and small enough that block * stride stays below 2^32.
uint32_t permutation_stride(uint32_t n) {
  if (n < 3) return 1;
  uint32_t stride = std::max(1u, std::min(uint32_t(0.618 * n), 0xffffffffu / n));
  while (std::gcd(stride, n) != 1) --stride;
  return stride;
}

/// At most an eighth of a GPU's memory, and no dispatch beyond what the device takes.
uint32_t most_paths(const ks::Device& device, uint32_t shadow_rays_per_vertex) {
  if (device.is_cpu()) return cpu_wave / (1 + shadow_rays_per_vertex / 4);
  constexpr uint64_t smallest_group = 32;
  const uint64_t fits =
      std::min<uint64_t>(device.info().memory_bytes / 8 / path_bytes, device.limits().maxComputeWorkGroupCount[0] * smallest_group);
  return uint32_t(std::min<uint64_t>(fits, gpu_wave)) / (1 + shadow_rays_per_vertex / 4);
}

uint32_t round_up(uint32_t n, uint32_t step) { return (n + step - 1) / step * step; }

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

/// Everything one render call needs; records stage after stage.
class PathTracer::Run {
 public:
  Run(PathTracer& owner, const Launch& launch, ks::Commands& commands)
      : o_(owner), launch_(launch), commands_(commands), budget_(launch.samples, launch.max_seconds, launch.relative_error) {}
  void prepare(const Scene& scene);
  void render();
  [[nodiscard]] std::vector<std::pair<std::string, double>> stage_times() const { return commands_.stage_times(); }
  [[nodiscard]] RenderSummary summary() const {
    return {samples_before() + (keeps_sums() ? 0 : budget_.done()), budget_.done(), relative_error_, seconds()};
  }

 private:
  void fit_buffers();
  void begin_accumulation();
  void render_round();
  void finish_round();
  void develop();
  void denoise();
  void render_aovs(uint32_t first_pixel, uint32_t pixel_count);
  void render_pixels(uint32_t first_pixel, uint32_t pixel_count);
  void trace_paths();
  void generate(const WaveRange& range, uint32_t flags);
  void shade(uint32_t bounce);
  void trace_shadows(uint32_t bounce);
  void resolve(uint32_t bounce);
  void accumulate(const WaveRange& range, bool last);
  [[nodiscard]] WaveRange range(uint32_t first_pixel, uint32_t pixel_count, uint32_t first_sample, uint32_t sample_count) const;
  void report(uint32_t pixels_done, float part);
  [[nodiscard]] bool denoises() const { return launch_.denoise != DenoiseKind::none && launch_.wants_radiance(); }
  [[nodiscard]] WaveRays rays_of(const WaveRange& wave) const {
    return {o_.buffers_.closest_rays(0), o_.tables_.address(), o_.views_.address(), wave};
  }
  /// Who asks for progress hears of it as it is made; else a GPU gets several waves at once, and not so many that a watchdog minds.
  [[nodiscard]] bool ends_submission(uint32_t wave) const { return o_.device_->is_cpu() || launch_.cancelled || wave % 8 == 7; }
  [[nodiscard]] bool glass_shadows() const { return o_.buffers_.size().glass_surfaces > 0; }
  /// Of light, kept apart.
  [[nodiscard]] uint32_t groups() const {
    return launch_.wants(output_light_group, output_light_group + light_group_count) ? group_ambient + o_.tables_.light_groups()
                                                                                     : group_count;
  }
  [[nodiscard]] uint32_t last_bounce() const { return last_lit() + (o_.tables_.has_ambient() ? 1 : 0); }
  /// The last pass that asks for light.
  [[nodiscard]] uint32_t last_lit() const { return launch_.max_bounces + o_.tables_.walk_passes(); }

  /// Sums outlive the wave: later rounds or calls go on with them.
  [[nodiscard]] bool keeps_sums() const { return launch_.accumulate || launch_.has_budget(); }
  [[nodiscard]] uint32_t samples_before() const { return keeps_sums() ? o_.accumulation_.samples() : 0; }
  [[nodiscard]] uint32_t first_sample() const { return keeps_sums() ? o_.accumulation_.first_sample() : launch_.first_sample; }
  [[nodiscard]] uint32_t most_pass_samples() const { return launch_.has_budget() ? budget_pass_samples : pass_samples; }
  [[nodiscard]] uint32_t sum_planes() const {
    return launch_.band.channels() * (groups() + (launch_.wants_variance() ? replicate_count : 0));
  }
  [[nodiscard]] double seconds() const { return milliseconds_since(start_) / 1e3; }

  PathTracer& o_;
  const Launch& launch_;
  ks::Commands& commands_;
  Budget budget_;
  double relative_error_ = std::numeric_limits<double>::quiet_NaN();
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  uint32_t pixels_per_wave_ = 0;
  bool environments_ = false;
  bool camera_ = false;  // some view is more than a pinhole at rest
};

void PathTracer::Run::prepare(const Scene& scene) {
  environments_ = launch_.environment_count() > 1;
  auto start = std::chrono::steady_clock::now();
  const TimeSpan open = open_span(launch_);
  o_.tables_.update(scene, launch_.band, launch_.environment_count(), open);
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
  if (denoises()) o_.denoiser_.fit(launch_, o_.frame_);
  commands_.add_host_time("upload", milliseconds_since(start));
  start = std::chrono::steady_clock::now();
  o_.tracer_->update(scene, launch_.environment_count(), open);
  commands_.add_host_time("acceleration build", milliseconds_since(start));
}

void PathTracer::Run::fit_buffers() {
  const uint32_t shadows = o_.tables_.shadow_rays_per_vertex();
  const uint32_t most = most_paths(*o_.device_, shadows);
  const uint32_t samples = launch_.wants_radiance() ? std::min(launch_.samples, most_pass_samples()) : 1;
  pixels_per_wave_ = std::min(launch_.pixel_count(), std::max(most / samples, pixel_block));
  o_.buffers_.fit({round_up(pixels_per_wave_ * samples, pixel_block), launch_.band.channels(), groups(), shadows,
                   launch_.max_bounces + 3 + o_.tables_.walk_passes(), environments_, o_.tables_.features(),
                   keeps_sums() ? 0 : uint64_t(pixels_per_wave_) * sum_planes(), launch_.wants_visibility(),
                   shadows > 0 && o_.tables_.has_glass() ? launch_.glass_surfaces : 0});
}

void PathTracer::Run::begin_accumulation() {
  if (!keeps_sums()) return o_.accumulation_.clear();
  o_.accumulation_.begin({uint32_t(launch_.views.size()), launch_.width, launch_.height, launch_.band.channels(), groups(),
                          launch_.wants_variance(), denoises()},
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
}

void PathTracer::Run::finish_round() {
  if (keeps_sums()) o_.accumulation_.add(budget_.next());
  if (launch_.relative_error > 0)
    relative_error_ = kuafu::relative_error(o_.frame_.image(output_variance), o_.frame_.image(output_radiance),
                                            uint64_t(launch_.pixel_count()) * launch_.band.channels());
  budget_.round_done(seconds(), samples_before(), relative_error_);
}

void PathTracer::Run::render_round() {
  const uint32_t total = launch_.pixel_count();
  for (uint32_t first = 0; first < total; first += pixels_per_wave_) {
    const uint32_t count = std::min(pixels_per_wave_, total - first);
    if ((launch_.wants_aovs() || denoises()) && budget_.done() == 0) render_aovs(first, count);
    if (launch_.wants_radiance()) render_pixels(first, count);
    if (ends_submission(first / pixels_per_wave_) || first + count == total) commands_.flush();
    report(first, float(count));
  }
}

// Steps on whole images, in the order of the light: noise goes before the optics spread it, and the caller's format comes last.
void PathTracer::Run::develop() {
  if (denoises()) denoise();
  o_.film_.run(commands_, launch_, o_.frame_);
  for (uint32_t kind = 0; kind < output_kind_count; ++kind)
    if (launch_.outputs[kind].buffer && o_.frame_.holds(kind)) o_.stages_->write(commands_, o_.frame_.write(launch_, kind));
  commands_.flush();
}

void PathTracer::Run::denoise() {
  if (launch_.denoise == DenoiseKind::oidn) {
    const auto start = std::chrono::steady_clock::now();
    o_.denoiser_.filter_by_oidn(launch_, o_.frame_);
    commands_.add_host_time("denoise", milliseconds_since(start));
    return o_.denoiser_.sum(commands_);
  }
  o_.denoiser_.filter(commands_, samples_before() + (keeps_sums() ? 0 : budget_.done()));
  const uint32_t total = launch_.pixel_count(), step = std::max(1u, o_.buffers_.size().capacity / Denoiser::rays_per_pixel);
  for (uint32_t first = 0; first < total; first += step) {
    const WaveRange square = range(first, std::min(step, total - first), launch_.first_sample, Denoiser::rays_per_pixel);
    generate(square, 0);
    o_.tracer_->closest(commands_, o_.buffers_.closest_queue(0));
    o_.denoiser_.remodulate(commands_, rays_of(square));
    commands_.flush();
  }
  o_.denoiser_.sum(commands_);
}

void PathTracer::Run::report(uint32_t pixels_done, float part) {
  const float round = std::min(1.0f, (float(pixels_done) + part) / float(launch_.pixel_count()));
  const float fraction = (float(budget_.done()) + round * float(budget_.next())) / float(launch_.samples);
  if (launch_.cancelled && launch_.cancelled(fraction))
    ks::fail(KS_ERROR_CANCELLED, "the progress callback cancelled the render at %.0f %%", 100.0 * fraction);
}

WaveRange PathTracer::Run::range(uint32_t first_pixel, uint32_t pixel_count, uint32_t first_sample, uint32_t sample_count) const {
  const uint32_t blocks = launch_.pixel_count() / pixel_block;
  return {first_pixel,  pixel_count,   blocks,         permutation_stride(blocks), first_sample,
          sample_count, launch_.width, launch_.height, o_.buffers_.size().capacity};
}

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

// Where the rays are, there the stages are.
PathTracer::PathTracer(std::shared_ptr<ks::Device> device, TracerKind tracer, std::string oidn_library)
    : device_(std::move(device)),
      on_host_(wants_embree(*device_, tracer)),
      tracer_(make_tracer(device_, tracer)),
      stages_(on_host_ ? make_host_stages(device_) : make_device_stages(device_, *tracer_)),
      tables_(memory()),
      aov_tables_(memory()),
      buffers_(memory()),
      frame_(memory()),
      accumulation_(memory()),
      denoiser_(memory(), tracer_->queue_layout(), std::move(oidn_library)),
      film_(memory()) {}

PathTracer::~PathTracer() = default;

void PathTracer::render(const std::shared_ptr<const Scene>& scene, const Launch& launch) {
  next_scene_ = scene;
  // A recorder is made once and kept, unless an error leaves it in the middle of its work.
  std::unique_ptr<ks::Commands> commands = commands_ ? std::move(commands_) : std::make_unique<ks::Commands>(device_);
  commands->reset_stage_times();
  Run run(*this, launch, *commands);
  try {
    run.prepare(*scene);
    scene_ = scene;
    run.render();
  } catch (...) {
    accumulation_.clear();  // some pixels have more samples than others
    throw;
  }
  stage_times_ = run.stage_times();
  summary_ = run.summary();
  if (!launch.accumulate) accumulation_.clear();
  commands_ = std::move(commands);
}

}  // namespace kuafu
