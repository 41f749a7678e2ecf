// One render call of the path tracer. Thread rule: externally synchronised, as its owner.
#pragma once

#include <chrono>
#include <functional>

#include "pathtrace/budget.h"
#include "pathtrace/path_tracer.h"

namespace kuafu {

/// Everything one render call needs; records stage after stage.
class PathTracer::Run {
 public:
  Run(PathTracer& owner, const Launch& launch, ks::Commands& commands)
      : o_(owner),
        launch_(launch),
        commands_(commands),
        budget_(launch.samples, launch.pixel_count(), launch.max_seconds, launch.relative_error) {}
  void prepare(const Scene& scene);
  void render();
  [[nodiscard]] std::vector<std::pair<std::string, double>> stage_times() const { return commands_.stage_times(); }
  [[nodiscard]] RenderSummary summary() const {
    return {samples_before() + (keeps_sums() ? 0 : budget_.done()), budget_.done(), relative_error_, seconds()};
  }

 private:
  friend class Wave;
  void check_countable() const;
  void fit_buffers();
  void begin_accumulation();
  void render_round();
  void finish_round();
  void develop();
  void denoise();
  /// Rays over pixels' squares, as many as the denoiser asks for.
  void in_squares(uint32_t pixels, const std::function<void(Wave&)>& step);
  void render_pixels(uint32_t first_pixel, uint32_t pixel_count);
  /// Takes a batch through `step`: a device's as one wave, the host's as many as its workers' slots make of it.
  void in_waves(const WaveRange& batch, const std::function<void(Wave&)>& step);
  [[nodiscard]] WaveRange range(uint32_t first_pixel, uint32_t pixel_count, uint32_t first_sample, uint32_t sample_count) const;
  void report(uint32_t pixels_done, float part);
  [[nodiscard]] bool denoises() const { return launch_.denoise != DenoiseKind::none && launch_.wants_radiance(); }
  /// Who asks for progress hears of it as it is made; else a GPU gets several batches at once, and not so many that a watchdog minds.
  [[nodiscard]] bool ends_submission(uint32_t batch) const { return o_.device_->is_cpu() || launch_.cancelled || batch % 8 == 7; }
  /// Whether shadow rays may pass something on their way.
  [[nodiscard]] bool passes_glass() const {
    return o_.tables_.shadow_rays_per_vertex() > 0 && o_.tables_.has_glass() && launch_.glass_surfaces > 0;
  }
  /// Of light, kept apart.
  [[nodiscard]] uint32_t groups() const {
    return launch_.wants(output_light_group, output_light_group + light_group_count) ? group_ambient + o_.tables_.light_groups()
                                                                                     : group_count;
  }
  [[nodiscard]] uint32_t last_bounce() const { return last_lit() + (o_.tables_.has_ambient() ? 1 : 0); }
  /// The last pass that asks for light.
  [[nodiscard]] uint32_t last_lit() const { return launch_.max_bounces + o_.tables_.walk_passes(); }

  /// Sums outlive the wave: later rounds or calls go on with them.
  [[nodiscard]] bool keeps_sums() const { return (launch_.accumulate || launch_.has_budget()) && launch_.wants_radiance(); }
  [[nodiscard]] uint32_t samples_before() const { return keeps_sums() ? o_.accumulation_.samples() : 0; }
  [[nodiscard]] uint32_t first_sample() const { return keeps_sums() ? o_.accumulation_.first_sample() : launch_.first_sample; }
  /// Of a pixel in one wave; fixed, since the order of sums follows from it. A budget renders in rounds, which are short.
  [[nodiscard]] uint32_t most_pass_samples() const { return launch_.has_budget() ? 32 : 256; }
  [[nodiscard]] uint32_t sum_planes() const {
    return launch_.band.channels() * (groups() + (launch_.wants_variance() ? replicate_count : 0));
  }
  [[nodiscard]] double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

  PathTracer& o_;
  const Launch& launch_;
  ks::Commands& commands_;
  Budget budget_;
  double relative_error_ = std::numeric_limits<double>::quiet_NaN();
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  uint32_t pixels_per_batch_ = 0;
  WaveRange batch_{};  // being rendered
  bool environments_ = false;
  bool camera_ = false;  // some view is more than a pinhole at rest
};

}  // namespace kuafu
